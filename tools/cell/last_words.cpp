#include "tools/cell/last_words.hpp"

#include <spdlog/spdlog.h>

#include <cmath>
#include <exception>
#include <fstream>

namespace invar::tools {

std::filesystem::path progress_file(const std::filesystem::path& outcome) {
  std::filesystem::path file = outcome;
  return outcome.empty() ? file : file += ".progress";
}

void write_whole(const std::filesystem::path& file, const nlohmann::json& json) noexcept {
  try {
    std::filesystem::path part = file;
    part += ".part";
    std::ofstream stream{part};
    stream << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    stream.close();
    if (stream) return std::filesystem::rename(part, file);
    std::filesystem::remove(part);
  } catch (const std::exception& error) {
    spdlog::warn("{} was not written: {}", file.string(), error.what());
  }
}

nlohmann::json loop_outcome(const ProcessStatus& status, Duration period) {
  nlohmann::json json{{"process", status.process},
                      {"cycles", status.counters.executed},
                      {"overruns", status.counters.overruns},
                      {"skipped", status.counters.skipped},
                      {"rate", 1.0 / period.in_seconds()},
                      {"compute_p50_ns", status.compute.p50.ns},
                      {"compute_p99_ns", status.compute.p99.ns},
                      {"wake_up_p50_ns", status.wake_up.p50.ns},
                      {"wake_up_p99_ns", status.wake_up.p99.ns},
                      {"not_granted", status.not_granted},
                      {"late_inputs", nlohmann::json::array()}};
  if (status.latency_limit) {
    json["latency_limit_ns"] = status.latency_limit->ns;
    json["late"] = status.counters.late;
  }
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
