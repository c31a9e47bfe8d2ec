// Families: the metrics of one look, by name, as Prometheus wants them.
#pragma once

#include <prometheus/metric_family.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace invar::tools {

using Labels = std::vector<std::pair<std::string, std::string>>;

/// Names follow the conventions of Prometheus: base units, `_total` for counts that only grow.
class Families {
 public:
  /// `name` without the prefix `invar_`.
  void count(const std::string& name, const std::string& help, const Labels& labels, std::uint64_t value);
  void gauge(const std::string& name, const std::string& help, const Labels& labels, double value);
  [[nodiscard]] const std::vector<prometheus::MetricFamily>& all() const { return all_; }

 private:
  prometheus::MetricFamily& family(const std::string& name, const std::string& help,
                                   prometheus::MetricType type);
  std::vector<prometheus::MetricFamily> all_;
  std::map<std::string, std::size_t> index_;
};

}  // namespace invar::tools
