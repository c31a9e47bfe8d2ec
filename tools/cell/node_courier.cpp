#include "tools/cell/node_courier.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "core/config/yaml.hpp"
#include "core/dds/node.hpp"

namespace invar::tools {

std::optional<NodeCourier::Addressee> NodeCourier::on_another_host(const std::string& topic) const {
  for (const auto& process : cell_.processes)
    for (const auto& component : process.components)
      if (topic.starts_with(dds::topic_name(cell_.name, component.name, "")))
        return process.host == host_ ? std::nullopt : std::optional{Addressee{process.name, component.name}};
  return std::nullopt;
}

std::future<std::filesystem::path> NodeCourier::bring(const std::string& topic,
                                                      const std::filesystem::path& file) {
  std::promise<std::filesystem::path> promise;
  auto brought = promise.get_future();
  const auto to = on_another_host(topic);
  if (!to) {
    promise.set_value(file);
    return brought;
  }
  threads_.emplace_back([this, to = *to, file, promise = std::move(promise)]() mutable {
    try {
      promise.set_value(send(to, file));
    } catch (...) {
      promise.set_exception(std::current_exception());
    }
  });
  return brought;
}

std::filesystem::path NodeCourier::send(const Addressee& to, const std::filesystem::path& file) {
  constexpr Duration patience = Duration::milliseconds(5000);
  const std::string text = config::Yaml::load(file).text();
  const std::lock_guard lock{mutex_};
  if (!client_) client_ = std::make_unique<dds::CellClient>(node_, cell_.name);
  const auto reply = client_->model(to.process, to.component, text, patience);
  const std::string process = "process `" + to.process + "`";
  if (!reply)
    throw std::runtime_error{process + " does not take the model of `" + to.component + "`: no answer" +
                             client_->clocks_apart(to.process)};
  if (!reply->done()) throw std::runtime_error{process + " refused the model: " + reply->text().c_str()};
  return reply->path().c_str();
}

}  // namespace invar::tools
