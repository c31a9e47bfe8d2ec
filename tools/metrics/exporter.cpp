#include "tools/metrics/exporter.hpp"

#include <arpa/inet.h>
#include <prometheus/collectable.h>
#include <prometheus/exposer.h>

#include <algorithm>
#include <charconv>
#include <mutex>

#include "core/base/fault.hpp"
#include "core/base/shown.hpp"

namespace invar::tools {

namespace {

/// The words of the library's server mean more than an address, `80r` a redirection: only these two pass.
void check(const std::string& listen) {
  const auto colon = listen.find(':');
  const std::string address = listen.substr(0, colon),
                    port = colon == std::string::npos ? "" : listen.substr(colon + 1);
  in_addr parsed{};
  int number = 0;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (inet_pton(AF_INET, address.c_str(), &parsed) != 1 || error != std::errc{} ||
      end != port.data() + port.size() || number < 1 || number > 65535)
    throw InputError{"--listen", "`" + clipped(listen) + "` is no address with a port",
                     "write 127.0.0.1:9464, or 0.0.0.0:9464 for all networks of this PC"};
}

std::vector<std::string> server_options(const std::string& listen) {
  return {"listening_ports",   listen, "num_threads",      "8",   "request_timeout_ms", "1000",
          "enable_keep_alive", "no",   "max_request_size", "8192"};
}

}  // namespace

class Exporter::Page final : public prometheus::Collectable {
 public:
  explicit Page(std::vector<prometheus::MetricFamily> families) : families_{std::move(families)} {}
  void set(std::vector<prometheus::MetricFamily> families) {
    const std::lock_guard lock{mutex_};
    families_ = std::move(families);
  }
  [[nodiscard]] std::vector<prometheus::MetricFamily> Collect() const override {
    const std::lock_guard lock{mutex_};
    return families_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<prometheus::MetricFamily> families_;
};

Exporter::Exporter(const std::string& listen, std::vector<prometheus::MetricFamily> first)
    : page_{std::make_shared<Page>(std::move(first))} {
  check(listen);
  try {
    exposer_ = std::make_unique<prometheus::Exposer>(server_options(listen));
  } catch (const std::exception&) {
    throw InputError{"--listen", "this PC does not listen on " + listen,
                     "name an address of this PC and a port that no other program has"};
  }
  exposer_->RegisterCollectable(page_);
}

Exporter::~Exporter() = default;

void Exporter::set(std::vector<prometheus::MetricFamily> families) { page_->set(std::move(families)); }

}  // namespace invar::tools
