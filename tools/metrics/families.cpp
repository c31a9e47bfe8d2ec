#include "tools/metrics/families.hpp"

#include "core/base/name.hpp"

namespace invar::tools {

namespace {

/// Whatever a program of the cell calls itself: one line of letters.
prometheus::ClientMetric with(const Labels& labels) {
  prometheus::ClientMetric metric;
  metric.label.reserve(labels.size());
  for (const auto& [name, value] : labels) metric.label.push_back({name, printable(value)});
  return metric;
}

}  // namespace

prometheus::MetricFamily& Families::family(const std::string& name, const std::string& help,
                                           prometheus::MetricType type) {
  const auto [known, is_new] = index_.try_emplace(name, all_.size());
  if (is_new) all_.push_back({"invar_" + name, help, type, {}});
  return all_[known->second];
}

void Families::count(const std::string& name, const std::string& help, const Labels& labels,
                     std::uint64_t value) {
  prometheus::ClientMetric metric = with(labels);
  metric.counter.value = static_cast<double>(value);
  family(name, help, prometheus::MetricType::Counter).metric.push_back(std::move(metric));
}

void Families::gauge(const std::string& name, const std::string& help, const Labels& labels, double value) {
  prometheus::ClientMetric metric = with(labels);
  metric.gauge.value = value;
  family(name, help, prometheus::MetricType::Gauge).metric.push_back(std::move(metric));
}

}  // namespace invar::tools
