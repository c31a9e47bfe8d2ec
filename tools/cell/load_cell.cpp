#include "tools/cell/load_cell.hpp"

#include <algorithm>

#include "components/all.hpp"
#include "core/base/shown.hpp"
#include "core/config/yaml.hpp"
#include "core/job/job_component.hpp"
#include "tools/cell/bridge_file.hpp"
#include "tools/cell/connections.hpp"
#include "tools/cell/plugins.hpp"
#include "tools/cell/qos.hpp"
#include "tools/cell/reach.hpp"
#include "tools/cell/standbys.hpp"

namespace invar::tools {

namespace {

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// Where the cell has no plugin, the type may be one of the reader's own.
std::string mend_type(const std::string& type, const std::vector<std::string>& names, bool no_plugins) {
  const std::string near = config::nearest(type, names);
  if (near.empty())
    return "use one of: " + list(names) + (no_plugins ? "; or name its library under `plugins`" : "");
  return "did you mean `" + near + "`?" + (no_plugins ? " Else name its library under `plugins`" : "");
}

/// `types_known`: an unknown type is a fault, for no plugin that may bring it is missing.
void prepare(LoadedCell& loaded, const config::CellComponent& component, bool types_known) {
  LoadedComponent result;
  result.file = &component;
  if (!loaded.registry->has(component.type)) {
    component.node.accept_all();
    if (!component.type.empty() && types_known)
      component.node["type"].fault(
          "`" + clipped(component.type) + "` is no component type",
          mend_type(component.type, loaded.registry->names(), loaded.cell->plugins.empty()));
    loaded.processes.back().components.push_back(std::move(result));
    return;
  }
  const auto faults_before = loaded.yaml.fault_count();
  result.prepared = loaded.registry->prepare(component.type, component.node, loaded.cell->file.parent_path());
  if (loaded.yaml.fault_count() == faults_before) {
    try {
      result.component = result.prepared.make();
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults())
        component.node.fault(fault.where + ": " + fault.what, fault.mend);
    }
  }
  if (result.component) {
    result.component->name = component.name;
    result.component->cell = loaded.cell->id;
    result.component->id = component.id;
  }
  loaded.processes.back().components.push_back(std::move(result));
}

/// The names of a component's own jobs: `jobs[0].name` and the like of its parameters.
std::vector<std::string> job_names(const LoadedComponent& member) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : member.prepared.infos)
    if (info.path.ends_with("].name") && std::count(info.path.begin(), info.path.end(), '.') == 1 &&
        !info.otherwise.empty())
      names.push_back(info.otherwise);
  return names;
}

/// The last word of a parameter's path: `out` of `jobs[0].out`.
std::string last_word(const std::string& path) { return path.substr(path.find_last_of('.') + 1); }

/// What the cell file itself names is what a command may name: the file's own folder, the folders of `models`, where the
/// components write results or keep their state, and each model that is named for a component or a job.
void find_places(LoadedCell& loaded) {
  loaded.model_places = loaded.cell->models;
  loaded.model_places.push_back(std::filesystem::absolute(loaded.cell->file).parent_path());
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const ParameterInfo& info : member.prepared.infos) {
        const std::string name = last_word(info.path);
        const bool is_result = name == "out",
                   is_named = name == "state" || name == "apply" || info.type == "file";
        if (info.otherwise.empty() || info.path.find("[]") != std::string::npos) continue;
        if (is_result) loaded.result_places.emplace_back(info.otherwise);
        if (is_result || is_named) loaded.model_places.emplace_back(info.otherwise);
      }
}

/// Every job of the cell must be one of the component that is to run it.
void check_jobs(const LoadedCell& loaded) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const auto& [job, component] : loaded.cell->jobs) {
        if (component != member.file->name || !member.component) continue;
        const config::Node at = loaded.yaml.root()["jobs"][job];
        auto* runs = dynamic_cast<job::JobComponent*>(member.component.get());
        if (runs == nullptr)
          at.fault("`" + component + "` runs no jobs", "name the component that runs it");
        else if (!runs->has(job))
          at.fault("`" + component + "` has no job `" + clipped(job) + "`",
                   config::mend_name(job, job_names(member)));
      }
}

}  // namespace

LoadedCell load_cell(const std::filesystem::path& file) {
  LoadedCell loaded{config::Yaml::load(file), nullptr, std::make_shared<Registry>(), {}, {}, {}};
  loaded.cell = std::make_unique<config::Cell>(config::read_cell(loaded.yaml));
  add_all_components(*loaded.registry);
  const bool types_known = load_plugins(*loaded.cell, *loaded.registry, loaded.yaml.root());
  for (const config::CellProcess& process : loaded.cell->processes) {
    loaded.processes.push_back({&process, {}});
    for (const config::CellComponent& component : process.components) prepare(loaded, component, types_known);
  }
  pair_standbys(loaded);
  connect_ports(loaded);
  check_standbys(loaded);
  check_qos(loaded);
  check_jobs(loaded);
  check_reach(loaded);
  (void)read_bridge(loaded);
  find_places(loaded);
  loaded.yaml.finish();
  return loaded;
}

}  // namespace invar::tools
