#include "tools/live/status_view.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <nlohmann/json.hpp>

#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

std::string three(const lifecycle::Percentiles& p) {
  if (p.max_ns() == 0) return "-";
  return microseconds_text(p.p50_ns()) + " / " + microseconds_text(p.p99_ns()) + " / " +
         microseconds_text(p.p999_ns());
}

nlohmann::ordered_json json_of(const lifecycle::Percentiles& p) {
  return {{"p50_ns", p.p50_ns()}, {"p99_ns", p.p99_ns()}, {"p999_ns", p.p999_ns()}, {"max_ns", p.max_ns()}};
}

std::string clock_text(const lifecycle::ProcessStatus& process) {
  if (process.simulated()) return "simulated";
  if (!process.realtime_asked()) return "not asked";
  return process.realtime_granted() ? "granted" : "not granted";
}

std::string level_text(event::Severity level) {
  constexpr std::array words{"note", "warning", "fault", "trip"};
  const auto index = static_cast<std::size_t>(level);
  return index < words.size() ? words[index] : "?";
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

}  // namespace

bool CellStatus::healthy() const {
  return missing.empty() && silent.empty() && !processes.empty() &&
         std::none_of(components.begin(), components.end(),
                      [](const auto& c) { return c.state() == lifecycle::STATE_ERROR; }) &&
         std::all_of(processes.begin(), processes.end(),
                     [](const auto& p) { return p.trip_reason().to_string().empty(); });
}

std::string state_text(lifecycle::ComponentState state) {
  constexpr std::array words{"unconfigured", "inactive", "active", "finalized", "error"};
  const auto index = static_cast<std::size_t>(state);
  return index < words.size() ? words[index] : "?";
}

void print(const CellStatus& status, std::ostream& out) {
  TextTable processes{{"process", "host", "pid>", "rate [Hz]>", "real time", "cycles>", "overruns>",
                       "skipped>", "late>", "wake-up p50/p99/p99.9 [us]>", "compute p50/p99/p99.9 [us]>",
                       "lost>"}};
  for (const auto& p : status.processes)
    processes.add({p.process_name().c_str(), p.host().c_str(), std::to_string(p.pid()), number_text(p.rate()),
                   status.silent.contains(p.process_name().c_str()) ? "silent" : clock_text(p),
                   std::to_string(p.cycles()), std::to_string(p.overruns()), std::to_string(p.skipped()),
                   p.latency_limit_ns() > 0 ? std::to_string(p.late()) : "-", three(p.wake_up()),
                   three(p.compute()), std::to_string(p.lost())});
  for (const auto& name : status.missing)
    processes.add({name, "", "-", "-", "no answer", "-", "-", "-", "-", "-", "-", "-"});
  processes.print(out);

  TextTable components{
      {"component", "process", "type", "state", "steps>", "step p50/p99/p99.9 [us]>", "lost>", "failure"}};
  for (const auto& c : status.components)
    components.add({c.component_name().c_str(), c.process_name().c_str(), c.component_type().c_str(),
                    state_text(c.state()), std::to_string(c.steps()), three(c.compute()),
                    std::to_string(c.lost()), c.failure().c_str()});
  out << '\n';
  components.print(out);

  TextTable latencies{{"latency of", "declared [us]>", "late>", "p50/p99/p99.9 [us]>"}};
  for (const auto& p : status.processes)
    if (p.latency_limit_ns() > 0)
      latencies.add({p.process_name().c_str(), microseconds_text(p.latency_limit_ns()),
                     std::to_string(p.late()), three(p.latency())});
  for (const auto& c : status.components)
    for (const auto& input : c.inputs())
      latencies.add({std::string{c.component_name().c_str()} + "." + input.port().c_str(),
                     microseconds_text(input.limit_ns()), std::to_string(input.late()), three(input.age())});
  if (!latencies.empty()) {
    out << '\n';
    latencies.print(out);
  }

  for (const auto& p : status.processes) {
    if (!p.trip_reason().to_string().empty())
      out << '\n' << p.process_name().c_str() << ": tripped: " << p.trip_reason().c_str() << '\n';
    if (p.realtime_asked() && !p.realtime_granted() && !p.simulated())
      out << '\n' << p.process_name().c_str() << ": " << p.realtime_text().c_str() << '\n';
  }

  auto warnings = status.notices;
  std::erase_if(warnings, [](const auto& notice) { return notice.level() < event::SEVERITY_WARNING; });
  std::stable_sort(warnings.begin(), warnings.end(),
                   [](const auto& a, const auto& b) { return a.at().time_ns() < b.at().time_ns(); });
  constexpr std::size_t most = 5;
  if (!warnings.empty()) out << "\nlast warnings\n";
  for (std::size_t i = warnings.size() > most ? warnings.size() - most : 0; i < warnings.size(); ++i)
    out << time_text(warnings[i].at().time_ns()) << "  " << level_text(warnings[i].level()) << "  "
        << warnings[i].source().c_str() << ": " << warnings[i].text().c_str() << '\n';
}

nlohmann::ordered_json to_json(const CellStatus& status) {
  nlohmann::ordered_json json{{"cell", status.cell},
                              {"healthy", status.healthy()},
                              {"missing", status.missing},
                              {"processes", nlohmann::ordered_json::array()},
                              {"components", nlohmann::ordered_json::array()}};
  for (const auto& p : status.processes)
    json["processes"].push_back({{"name", p.process_name().c_str()},
                                 {"host", p.host().c_str()},
                                 {"pid", p.pid()},
                                 {"rate", p.rate()},
                                 {"time_ns", p.at().time_ns()},
                                 {"silent", status.silent.contains(p.process_name().c_str())},
                                 {"simulated", p.simulated()},
                                 {"realtime_asked", p.realtime_asked()},
                                 {"realtime_granted", p.realtime_granted()},
                                 {"realtime_text", p.realtime_text().c_str()},
                                 {"cycles", p.cycles()},
                                 {"overruns", p.overruns()},
                                 {"skipped", p.skipped()},
                                 {"trip_reason", p.trip_reason().c_str()},
                                 {"wake_up", json_of(p.wake_up())},
                                 {"compute", json_of(p.compute())},
                                 {"latency", json_of(p.latency())},
                                 {"latency_limit_ns", p.latency_limit_ns()},
                                 {"late", p.late()},
                                 {"lost", p.lost()}});
  for (const auto& c : status.components) {
    auto inputs = nlohmann::ordered_json::array();
    for (const auto& input : c.inputs())
      inputs.push_back({{"port", input.port().c_str()},
                        {"limit_ns", input.limit_ns()},
                        {"late", input.late()},
                        {"age", json_of(input.age())}});
    json["components"].push_back({{"name", c.component_name().c_str()},
                                  {"process", c.process_name().c_str()},
                                  {"type", c.component_type().c_str()},
                                  {"state", state_text(c.state())},
                                  {"failure", c.failure().c_str()},
                                  {"every", c.every()},
                                  {"steps", c.steps()},
                                  {"lost", c.lost()},
                                  {"compute", json_of(c.compute())},
                                  {"inputs", std::move(inputs)}});
  }
  json["notices"] = nlohmann::ordered_json::array();
  for (const auto& notice : status.notices)
    json["notices"].push_back({{"time_ns", notice.at().time_ns()},
                               {"level", level_text(notice.level())},
                               {"source", notice.source().c_str()},
                               {"text", notice.text().c_str()}});
  return json;
}

}  // namespace invar::tools
