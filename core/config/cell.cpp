#include "core/config/cell.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <set>

#include "core/base/limits.hpp"
#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::config {

namespace {

/// Names become file names and bounded strings on the wire; those of cells and components stand in topics too, which must
/// not have a `-` (Cyclone DDS refuses to read them).
enum class In { topics, files };
void check_name(const Node& node, const std::string& name, In where) {
  const auto flaw = flaw_of_identifier(name, where == In::files ? "-" : "");
  if (flaw)
    node.fault("`" + clipped(name) + "` is no name: it " + flaw->what,
               flaw->mend + (where == In::files ? "" : ", since it stands in topics"));
}

void check_file(const Node& node, const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return;
  if (error == std::errc::permission_denied)
    node.fault("file `" + path.string() + "` cannot be read",
               "check its permissions and those of its folder");
  else
    node.fault("file `" + path.string() + "` does not exist", "paths count from the cell file's folder");
}

  std::size_t components = 0;
  for (const Node& process : processes.map()) components += process["components"].map().size();
  if (components > limits::cell_components) {
    processes.fault("hold " + std::to_string(components) + " components",
                    "keep at most " + std::to_string(limits::cell_components));
    yaml.finish();
  }
  for (const Node& process : processes.map())
    cell.processes.push_back(read_process(process, cell.hosts, next_id));
  constexpr std::size_t most_processes = 64;
  if (processes.is_map() && cell.processes.empty()) processes.fault("has no processes", "name at least one");
  if (cell.processes.size() > most_processes)
    processes.fault("has " + std::to_string(cell.processes.size()) + " processes",
                    "use at most " + std::to_string(most_processes) + ": several components fit in one");
  check_identities(root, cell);
  if (const Node security = root["security"]; security.exists()) {
    cell.security = read_security(security, cell.file.parent_path());
    check_key_names(security, cell);
  }
  for (const Node& job : root["jobs"].map()) {
    cell.jobs[job.key()] = job.as_text();
    if (job.is_scalar() && cell.find(job.as_text()) == nullptr)
      job.fault("`" + clipped(job.as_text()) + "` is no component of this cell",
                "name the component that runs the job");
  }
  return cell;
}

}  // namespace invar::config
