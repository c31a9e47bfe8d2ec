#include "tools/live/status_view.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>

#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

nlohmann::ordered_json json_of(const lifecycle::Percentiles& p) {
  return {{"p50_ns", p.p50_ns()}, {"p99_ns", p.p99_ns()}, {"p999_ns", p.p999_ns()}, {"max_ns", p.max_ns()}};
}

/// null: a cell on one host, or not measured yet.
nlohmann::ordered_json json_of_clock(const lifecycle::ProcessStatus& p) {
  if (p.clock_reference().to_string().empty() || p.clock_error_ns() < 0) return nullptr;
  return {{"reference", p.clock_reference().c_str()},
          {"ahead_ns", p.clock_ahead_ns()},
          {"error_ns", p.clock_error_ns()}};
}

std::string clock_text(const lifecycle::ProcessStatus& process) {
  if (process.pid() == 0) return "ended";
  if (process.simulated()) return "simulated";
  if (!process.realtime_asked()) return "no";
  return process.realtime_granted() ? "granted" : "not granted";
}

/// UTC to the second; in simulated time the seconds since the start.
std::string time_text(std::int64_t ns) {
  const std::time_t seconds = ns / 1'000'000'000;
  if (seconds < 1'000'000'000) return number_text(static_cast<double>(ns) * 1e-9) + " s";
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%F %T", &utc)};
}

/// Durations since the start beside those of the last seconds, so that an old outlier does not hide how it is now.
void print_times(const CellStatus& status, std::ostream& out) {
  std::int64_t window = 0;
  for (const auto& p : status.processes) window = std::max(window, p.window_ns());
  const std::string recent = " in " + std::to_string((window + 500'000'000) / 1'000'000'000) + " s>";
  TextTable table{{"time of [us]", "p50>", "p99>", "p99.9>", "longest>", "p50" + recent, "p99" + recent,
                   "p99.9" + recent}};
  const auto add = [&](const std::string& what, const lifecycle::Percentiles& all,
                       const lifecycle::Percentiles* now, std::int64_t limit) {
    if (all.max_ns() == 0) return;
    const auto text = [](std::int64_t ns) { return microseconds_text(ns); };
    const bool any = now != nullptr && now->max_ns() > 0;
    table.add({limit > 0 ? what + ", at most " + text(limit) : what, text(all.p50_ns()), text(all.p99_ns()),
               text(all.p999_ns()), text(all.max_ns()), any ? text(now->p50_ns()) : "-",
               any ? text(now->p99_ns()) : "-", any ? text(now->p999_ns()) : "-"});
  };
  for (const auto& p : status.processes) {
    const std::string name = p.process_name().c_str();
    add(name + " wake-up", p.wake_up(), &p.recent_wake_up(), 0);
    add(name + " compute", p.compute(), &p.recent_compute(), 0);
    add(name + " latency", p.latency(), &p.recent_latency(), p.latency_limit_ns());
  }
  for (const auto& c : status.components) {
    const std::string name = c.component_name().c_str();
    add(name + " step", c.compute(), &c.recent_compute(), 0);
    for (const auto& input : c.inputs())
      add(name + "." + input.port().c_str() + " age, " + std::to_string(input.late()) + " late", input.age(),
          nullptr, input.limit_ns());
  }
  if (table.empty()) return;
  out << '\n';
  table.print(out);
}

/// The clocks of the hosts, of each host the process that knows its own best.
void print_clocks(const CellStatus& status, std::ostream& out) {
  std::map<std::string, const lifecycle::ProcessStatus*> hosts;
  std::string reference;
  for (const auto& p : status.processes) {
    if (p.clock_reference().to_string().empty() || p.pid() == 0) continue;
    reference = p.clock_reference().c_str();
    const auto [known, first] = hosts.try_emplace(p.host().c_str(), &p);
    const std::int64_t error = p.clock_error_ns(), before = known->second->clock_error_ns();
    if (!first && error >= 0 && (before < 0 || error < before)) known->second = &p;
  }
  if (hosts.size() < 2) return;
  TextTable table{{"clock of host", "ahead of " + reference + " [ms]>", "known within [ms]>"}};
  for (const auto& [host, p] : hosts)
    if (p->clock_error_ns() < 0)
      table.add({host, "not measured", "-"});
    else
      table.add({host, number_text(static_cast<double>(p->clock_ahead_ns()) * 1e-6),
                 number_text(static_cast<double>(p->clock_error_ns()) * 1e-6)});
  out << '\n';
  table.print(out);
}

/// Each component of the file is wanted active as long as its process lives.
bool is_wanted_but_not_active(const CellStatus& status, const lifecycle::ComponentStatus& component) {
  return is_inactive(component.state()) &&
         std::any_of(status.processes.begin(), status.processes.end(), [&](const auto& p) {
           return p.process_name() == component.process_name() && p.pid() != 0;
         });
}

}  // namespace

std::vector<std::string> CellStatus::faults() const {
  std::vector<std::string> lines;
  for (const auto& name : missing) lines.push_back(name + ": does not answer");
  for (const auto& p : processes) {
    const std::string name = p.process_name().c_str();
    if (p.pid() == 0) lines.push_back(name + ": ended with " + p.last_end().c_str());
    if (silent.contains(name)) lines.push_back(name + ": has fallen silent");
    if (!p.trip_reason().to_string().empty()) lines.push_back(name + ": tripped: " + p.trip_reason().c_str());
  }
  for (const auto& c : components) {
    const std::string name = c.component_name().c_str();
    if (c.state() == lifecycle::STATE_ERROR) lines.push_back(name + ": in error: " + c.failure().c_str());
    if (is_wanted_but_not_active(*this, c))
      lines.push_back(
          name + ": is " + state_text(c.state()) + "; `invar lifecycle CELL " + name + " " +
          (c.state() == lifecycle::STATE_UNCONFIGURED ? "configure`, then `activate`" : "activate`"));
    if (!c.fault().to_string().empty()) lines.push_back(name + ": " + c.fault().c_str());
  }
  return lines;
}

bool CellStatus::healthy() const { return !processes.empty() && faults().empty(); }

std::string CellStatus::security() const {
  return secured ? "secured by certificates"
                 : "unsecured, every program that reaches its network can read and command it; `invar keys "
                   "CELL` makes "
                   "the keys that mend it";
}

bool is_inactive(lifecycle::ComponentState state) {
  return state == lifecycle::STATE_UNCONFIGURED || state == lifecycle::STATE_INACTIVE;
}

std::string state_text(lifecycle::ComponentState state) {
  constexpr std::array words{"unconfigured", "inactive", "active", "finalized", "error"};
  const auto index = static_cast<std::size_t>(state);
  return index < words.size() ? words[index] : "?";
}

std::string level_text(event::Severity level) {
  constexpr std::array words{"note", "warning", "fault", "trip"};
  const auto index = static_cast<std::size_t>(level);
  return index < words.size() ? words[index] : "?";
}

std::string state_and_role(const lifecycle::ComponentStatus& component) {
  const std::string role = component.role().c_str();
  const std::string state = state_text(component.state());
  return role.empty() || component.state() != lifecycle::STATE_ACTIVE || role == state ? state
                                                                                       : state + ", " + role;
}

void print(const CellStatus& status, std::ostream& out) {
  print_wrapped("cell " + status.cell + ": " + status.security(), 2, out);
  out << '\n';
  TextTable processes{{"process", "host", "pid>", "real time", "rate [Hz]>", "cycles>", "overruns>",
                       "skipped>", "late>", "lost>", "restarts>"}};
  for (const auto& p : status.processes)
    processes.add({p.process_name().c_str(), p.host().c_str(), p.pid() == 0 ? "-" : std::to_string(p.pid()),
                   status.silent.contains(p.process_name().c_str()) ? "silent" : clock_text(p),
                   number_text(p.rate()), std::to_string(p.cycles()), std::to_string(p.overruns()),
                   std::to_string(p.skipped()), p.latency_limit_ns() > 0 ? std::to_string(p.late()) : "-",
                   std::to_string(p.lost()), std::to_string(p.restarts())});
  for (const auto& name : status.missing)
    processes.add({name, "", "-", "no answer", "-", "-", "-", "-", "-", "-", "-"});
  processes.print(out);

  TextTable components{{"component", "process", "type", "state", "steps>", "lost>"}};
  for (const auto& c : status.components)
    components.add({c.component_name().c_str(), c.process_name().c_str(), c.component_type().c_str(),
                    state_and_role(c), std::to_string(c.steps()), std::to_string(c.lost())});
  out << '\n';
  components.print(out);
  print_clocks(status, out);
  print_times(status, out);

  const auto faults = status.faults();
  if (!faults.empty()) out << "\nnot well\n";
  for (const auto& line : faults) print_wrapped(line, 2, out);
  for (const auto& p : status.processes) {
    const std::string name = p.process_name().c_str();
    if (p.realtime_asked() && !p.realtime_granted() && !p.simulated() && p.pid() != 0) {
      out << '\n';
      print_wrapped(name + ": " + p.realtime_text().c_str(), 2, out);
    }
    if (p.restarts() > 0 && p.pid() != 0) {
      out << '\n';
      print_wrapped(name + ": started again " + std::to_string(p.restarts()) +
                        " times; its last life ended with " + p.last_end().c_str(),
                    2, out);
    }
  }

  auto warnings = status.notices;
  std::erase_if(warnings, [](const auto& notice) { return notice.level() < event::SEVERITY_WARNING; });
  std::stable_sort(warnings.begin(), warnings.end(),
                   [](const auto& a, const auto& b) { return a.at().time_ns() < b.at().time_ns(); });
  constexpr std::size_t most = 5;
  TextTable last{{"last warnings", "", "source", "what"}};
  for (std::size_t i = warnings.size() > most ? warnings.size() - most : 0; i < warnings.size(); ++i)
    last.add({time_text(warnings[i].at().time_ns()), level_text(warnings[i].level()),
              warnings[i].source().c_str(), warnings[i].text().c_str()});
  if (last.empty()) return;
  out << '\n';
  last.print(out);
}

nlohmann::ordered_json json_of(const lifecycle::ProcessStatus& p, bool silent) {
  return {{"name", p.process_name().c_str()},
          {"host", p.host().c_str()},
          {"pid", p.pid()},
          {"rate_hz", p.rate()},
          {"time_ns", p.at().time_ns()},
          {"silent", silent},
          {"simulated", p.simulated()},
          {"realtime_asked", p.realtime_asked()},
          {"realtime_granted", p.realtime_granted()},
          {"realtime_text", p.realtime_text().c_str()},
          {"cycles", p.cycles()},
          {"overruns", p.overruns()},
          {"skipped", p.skipped()},
          {"trip_reason", p.trip_reason().c_str()},
          {"latency_limit_ns", p.latency_limit_ns()},
          {"late", p.late()},
          {"lost", p.lost()},
          {"restarts", p.restarts()},
          {"last_end", p.last_end().c_str()},
          {"clock", json_of_clock(p)},
          {"wake_up", json_of(p.wake_up())},
          {"compute", json_of(p.compute())},
          {"latency", json_of(p.latency())},
          {"recent",
           {{"window_ns", p.window_ns()},
            {"wake_up", json_of(p.recent_wake_up())},
            {"compute", json_of(p.recent_compute())},
            {"latency", json_of(p.recent_latency())}}}};
}

nlohmann::ordered_json json_of(const lifecycle::ComponentStatus& c) {
  auto inputs = nlohmann::ordered_json::array();
  for (const auto& input : c.inputs())
    inputs.push_back({{"port", input.port().c_str()},
                      {"limit_ns", input.limit_ns()},
                      {"late", input.late()},
                      {"age", json_of(input.age())}});
  return {{"name", c.component_name().c_str()},
          {"process", c.process_name().c_str()},
          {"type", c.component_type().c_str()},
          {"state", state_text(c.state())},
          {"role", c.role().to_string().empty() ? nlohmann::ordered_json{}
                                                : nlohmann::ordered_json(c.role().c_str())},
          {"failure", c.failure().c_str()},
          {"fault", c.fault().c_str()},
          {"every", c.every()},
          {"steps", c.steps()},
          {"lost", c.lost()},
          {"compute", json_of(c.compute())},
          {"recent", {{"compute", json_of(c.recent_compute())}}},
          {"inputs", std::move(inputs)}};
}

nlohmann::ordered_json to_json(const CellStatus& status) {
  nlohmann::ordered_json json{{"cell", status.cell},
                              {"secured", status.secured},
                              {"security", status.security()},
                              {"healthy", status.healthy()},
                              {"faults", status.faults()},
                              {"missing", status.missing},
                              {"processes", nlohmann::ordered_json::array()},
                              {"components", nlohmann::ordered_json::array()},
                              {"notices", nlohmann::ordered_json::array()}};
  for (const auto& p : status.processes)
    json["processes"].push_back(json_of(p, status.silent.contains(p.process_name().c_str())));
  for (const auto& c : status.components) json["components"].push_back(json_of(c));
  for (const auto& notice : status.notices)
    json["notices"].push_back({{"time_ns", notice.at().time_ns()},
                               {"level", level_text(notice.level())},
                               {"source", notice.source().c_str()},
                               {"text", notice.text().c_str()}});
  return json;
}

}  // namespace invar::tools
