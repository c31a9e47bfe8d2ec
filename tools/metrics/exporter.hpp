// Exporter: the page that Prometheus reads, over HTTP.
#pragma once

#include <prometheus/metric_family.h>

#include <memory>
#include <string>
#include <vector>

namespace prometheus {
class Exposer;
}

namespace invar::tools {

/// Serves `/metrics` and nothing else. Each request gets the metrics that were set last, so that however many ask, the cell is
/// looked at no more often. Eight requests are served at once; one that is not there whole after a second is dropped.
class Exporter {
 public:
  /// `listen`: "127.0.0.1:9464". Throws InputError where it is none, or cannot be listened on.
  Exporter(const std::string& listen, std::vector<prometheus::MetricFamily> first);
  ~Exporter();
  Exporter(const Exporter&) = delete;
  Exporter& operator=(const Exporter&) = delete;

  /// Any thread.
  void set(std::vector<prometheus::MetricFamily> families);

 private:
  class Page;
  std::shared_ptr<Page> page_;
  std::unique_ptr<prometheus::Exposer> exposer_;
};

}  // namespace invar::tools
