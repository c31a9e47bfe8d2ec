#include "tools/cell/last_words.hpp"
#include "core/base/new_file.hpp"

#include <spdlog/spdlog.h>

#include <cmath>
#include <exception>
#include <fstream>

namespace invar::tools {

std::filesystem::path progress_file(const std::filesystem::path& outcome) {
  std::filesystem::path file = outcome;
  return outcome.empty() ? file : file += ".progress";
}

std::filesystem::path rest_file(const std::filesystem::path& outcome) {
  return std::filesystem::path{outcome}.replace_extension(".rest");
}

void write_whole(const std::filesystem::path& file, const nlohmann::json& json) noexcept {
  try {
    std::filesystem::path part = file;
    part += ".part";
    std::ofstream stream = new_stream(part);
    stream << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    stream.close();
    if (stream) return std::filesystem::rename(part, file);
    std::filesystem::remove(part);
  } catch (const std::exception& error) {
    spdlog::warn("{} was not written: {}", file.string(), error.what());
  }
}

nlohmann::json loop_outcome(const ProcessStatus& status, Duration period) {
  const auto percentiles = [](const Percentiles& p) -> nlohmann::json {
    return {{"p50_ns", p.p50.ns}, {"p99_ns", p.p99.ns}, {"p999_ns", p.p999.ns}, {"max_ns", p.max.ns}};
  };
  nlohmann::json json{{"name", status.process},
                      {"rate_hz", 1.0 / period.in_seconds()},
                      {"simulated", status.simulated},
                      {"cycles", status.counters.executed},
                      {"overruns", status.counters.overruns},
                      {"skipped", status.counters.skipped},
                      {"trip_reason", status.trip_reason},
                      {"latency_limit_ns", status.latency_limit ? status.latency_limit->ns : 0},
                      {"late", status.counters.late},
                      {"wake_up", percentiles(status.wake_up)},
                      {"compute", percentiles(status.compute)},
                      {"latency", percentiles(status.latency)},
                      {"not_granted", status.not_granted},
                      {"late_inputs", nlohmann::json::array()}};
  for (const ComponentStatus& component : status.components)
    for (const InputAge& input : component.ages)
      json["late_inputs"].push_back({{"input", component.name + "." + input.port},
                                     {"limit_ns", input.limit.ns},
                                     {"late", input.late},
                                     {"steps", component.steps},
                                     {"max_ns", input.age.max.ns}});
  return json;
}

ProgressFile::ProgressFile(const std::filesystem::path& outcome) : file_{progress_file(outcome)} {}

void ProgressFile::leave(double fraction, const std::string& text) {
  if (!std::isfinite(fraction)) fraction = 0.0;  // JSON has no such number, and a job may say anything
  const auto now = std::chrono::steady_clock::now();
  if (file_.empty() || now - left_ < std::chrono::milliseconds{100}) return;
  if (fraction == fraction_ && text == text_) return;
  left_ = now;
  fraction_ = fraction;
  text_ = text;
  write_whole(file_, {{"fraction", fraction}, {"text", text}});
}

}  // namespace invar::tools
