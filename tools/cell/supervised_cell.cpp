#include "tools/cell/supervised_cell.hpp"

#include <utility>

#include "tools/cell/each_port.hpp"

namespace invar::tools {

/// Of the other processes in the cell file, and of this one, whose components the executor has.
void SupervisedCell::each_port_of_all(const Visit& visit) const {
  for (const LoadedProcess& process : loaded_.processes)
    for (const LoadedComponent& member : process.components)
      if (member.component)
        for (const Port* port : member.component->ports()) visit(member.file->name, *port);
  each_port(process_.executor, [&](std::size_t index, const Port& port) {
    visit(process_.executor.component(index).name, port);
  });
}

/// Component -> those that need its outputs.
std::map<std::string, std::vector<std::string>> SupervisedCell::dependents() const {
  std::map<std::string, std::string> writer;  // topic -> component
  each_port_of_all([&](const std::string& component, const Port& port) {
    // What two write is lost only with both.
    if (port.direction() == Port::Direction::output && !process_.shared_topics.contains(port.topic))
      writer[port.topic] = component;
  });
  std::map<std::string, std::vector<std::string>> found;
  each_port_of_all([&](const std::string& component, const Port& port) {
    if (port.direction() != Port::Direction::input || static_cast<const InputPort&>(port).options().optional)
      return;
    if (const auto from = writer.find(port.topic); from != writer.end() && from->second != component)
      found[from->second].push_back(component);
  });
  return found;
}

std::set<std::string> SupervisedCell::held() const {
  std::set<std::string> names;
  for (const LoadedProcess& process : loaded_.processes)
    for (const LoadedComponent& member : process.components)
      if (member.component && !member.component->claims().empty()) names.insert(member.file->name);
  for (std::size_t i = 0; i < process_.executor.size(); ++i)
    if (!process_.executor.component(i).claims().empty()) names.insert(process_.executor.component(i).name);
  return names;
}

std::set<std::string> SupervisedCell::heard() {
  std::set<std::string> names{process_.name};
  for (const auto& status : client_->processes()) {
    auto& last = last_status_[status.process_name().c_str()];
    if (status.pid() != 0 && status.at().time_ns() != last) names.insert(status.process_name().c_str());
    last = status.at().time_ns();
  }
  return names;
}

std::map<std::string, supervisor::CellView::Seen> SupervisedCell::components() const {
  std::map<std::string, supervisor::CellView::Seen> seen;
  for (const auto& status : client_->components())
    seen[status.component_name().c_str()] = {status.failure().c_str(),
                                             status.state() == lifecycle::STATE_ERROR,
                                             status.state() == lifecycle::STATE_ACTIVE};
  return seen;
}

std::string SupervisedCell::request(const std::string& component, lifecycle::Transition transition) {
  const auto reply =
      client_->request(client_->process_of(component), component, transition, Duration::seconds(5.0));
  if (!reply) return "its process does not answer";
  return reply->done() ? "" : reply->text().c_str();
}

supervisor::CellView SupervisedCell::view(
    std::function<void(bool is_fault, const std::string& source, const std::string& text)> notify) {
  supervisor::CellView view;
  view.dependents = dependents();
  for (const auto& process : loaded_.cell->processes) {
    view.processes.push_back(process.name);
    for (const auto& component : process.components) view.process_of[component.name] = process.name;
  }
  view.heard = [this] { return heard(); };
  view.components = [this] { return components(); };
  view.deactivate = [this](const std::string& component) {
    return request(component, lifecycle::TRANSITION_DEACTIVATE);
  };
  view.activate = [this](const std::string& component) {
    return request(component, lifecycle::TRANSITION_ACTIVATE);
  };
  view.held = held();
  view.notify = std::move(notify);
  return view;
}

}  // namespace invar::tools
