// NodeCourier: a ModelCourier over the cell's DDS node.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/component/model_courier.hpp"
#include "core/config/cell.hpp"
#include "core/dds/cell_client.hpp"

namespace invar::tools {

/// Processes of one host share its files; to a process of another host goes the text of the model.
class NodeCourier final : public ModelCourier {
 public:
  /// `cell` and `node` outlive it. `host`: of this process.
  NodeCourier(dds::Node& node, const config::Cell& cell, std::string host)
      : node_{node}, cell_{cell}, host_{std::move(host)} {}

  [[nodiscard]] std::future<std::filesystem::path> bring(const std::string& topic,
                                                         const std::filesystem::path& file) override;

 private:
  struct Addressee {
    std::string process, component;
  };
  [[nodiscard]] std::optional<Addressee> on_another_host(const std::string& topic) const;
  std::filesystem::path send(const Addressee& to, const std::filesystem::path& file);

  dds::Node& node_;
  const config::Cell& cell_;
  const std::string host_;
  std::mutex mutex_;
  std::unique_ptr<dds::CellClient> client_;  // made with the first model
  std::vector<std::jthread> threads_;        // last: they end before the rest
};

}  // namespace invar::tools
