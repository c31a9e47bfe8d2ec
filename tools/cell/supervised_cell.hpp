// SupervisedCell: the cell as its supervisor sees it, and how it acts on it by DDS.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "components/supervisor/supervisor.hpp"
#include "core/dds/cell_client.hpp"
#include "core/executor/executor.hpp"
#include "idl/lifecycle.h"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

class SupervisedCell {
 public:
  /// The process that runs the supervisor. `shared_topics`: those that either of two components writes.
  struct Process {
    const std::string& name;
    Executor& executor;
    const std::set<std::string>& shared_topics;
  };
  SupervisedCell(LoadedCell& loaded, const Process& process) : loaded_{loaded}, process_{process} {}

  /// The dependencies of the components, and how to look and act. `notify`: into the log and to the cell.
  [[nodiscard]] supervisor::CellView view(
      std::function<void(bool is_fault, const std::string& source, const std::string& text)> notify);
  /// Before the supervisor's first step.
  void connect(dds::Node& node) { client_ = std::make_unique<dds::CellClient>(node); }

 private:
  using Visit = std::function<void(const std::string& component, const Port& port)>;
  void each_port_of_all(const Visit& visit) const;
  [[nodiscard]] std::map<std::string, std::vector<std::string>> dependents() const;
  [[nodiscard]] std::set<std::string> held() const;
  [[nodiscard]] std::set<std::string> heard();
  [[nodiscard]] std::map<std::string, supervisor::CellView::Seen> components() const;
  /// Empty where it was done, else why not.
  [[nodiscard]] std::string request(const std::string& component, lifecycle::Transition transition);

  LoadedCell& loaded_;
  Process process_;
  std::unique_ptr<dds::CellClient> client_;
  std::map<std::string, std::int64_t> last_status_;
};

}  // namespace invar::tools
