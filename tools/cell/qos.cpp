#include "tools/cell/qos.hpp"

#include <map>
#include <string>
#include <vector>

#include "core/base/shown.hpp"
#include "core/component/port.hpp"
#include "core/dds/profile.hpp"
#include "idl/standby.h"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

namespace {

struct End {
  const LoadedComponent* member = nullptr;
  const config::CellProcess* process = nullptr;
  const Port* port = nullptr;

  [[nodiscard]] std::string name() const { return member->file->name + "." + port->name(); }
  /// Where the user wrote what decides this end's QoS.
  [[nodiscard]] config::Node place() const {
    const config::Node& node = member->file->node;
    return member->file->profiles.contains(port->name()) ? node["qos"][port->name()] : node;
  }
};

void check_profile(const End& end, const dds::Profiles& profiles) {
  if (profiles.contains(end.port->profile)) return;
  if (end.port->type() == typeid(standby::WarmState)) {
    end.member->file->node.fault(
        "another component stands by for it, and the file of `profiles` has no `" + end.port->profile + "`",
        "take it from the profiles that ship with Invar");
    return;
  }
  std::vector<std::string> names;
  std::string list;
  for (const auto& [name, profile] : profiles) {
    names.push_back(name);
    list += (list.empty() ? "" : ", ") + name;
  }
  const std::string near = config::nearest(end.port->profile, names);
  end.place().fault("`" + clipped(end.port->profile) + "` is no QoS profile",
                    near.empty() ? "use one of: " + list : "did you mean `" + near + "`?");
}

void compare(const End& writer, const End& reader, const dds::Profiles& profiles) {
  const bool joined_directly =
      writer.process == reader.process && reader.port->direction() == Port::Direction::input;
  const auto offered = profiles.find(writer.port->profile);
  const auto requested = profiles.find(reader.port->profile);
  if (joined_directly || offered == profiles.end() || requested == profiles.end()) return;
  for (const dds::Mismatch& mismatch : dds::mismatches(offered->second, requested->second))
    reader.place().fault("`" + reader.name() + "` (" + reader.port->profile + ") and `" + writer.name() +
                             "` (" + writer.port->profile + ") cannot meet: " + mismatch.text(),
                         "give both ends the same profile by `qos`");
}

}  // namespace

void check_qos(LoadedCell& loaded) {
  std::error_code unseen;
  if (!std::filesystem::is_regular_file(loaded.cell->profiles, unseen)) return;  // read_cell has said so
  const dds::Profiles profiles = dds::load_profiles(loaded.cell->profiles);
  std::map<std::string, std::vector<End>> writers;
  std::map<std::string, std::vector<End>> readers;
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      if (!member.component) continue;
      for (const Port* port : member.component->ports()) {
        const End end{&member, process.file, port};
        // A file of profiles from before is right as long as nobody stands by.
        if (port->topic.empty() && port->type() == typeid(standby::WarmState)) continue;
        check_profile(end, profiles);
        if (port->topic.empty()) continue;
        auto& side = port->direction() == Port::Direction::output ? writers : readers;
        side[port->topic].push_back(end);
      }
    }
  for (const auto& [topic, ends] : readers)
    for (const End& reader : ends)
      for (const End& writer : writers[topic]) compare(writer, reader, profiles);
}

}  // namespace invar::tools
