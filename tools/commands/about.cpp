// `invar about`: version, build and the libraries it stands on.
#include <fastdds/rtps/attributes/RTPSParticipantAttributes.h>

#include <Eigen/Core>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core/version.hpp>
#include <string>
#include <utility>

#include "tools/command.hpp"

namespace invar::tools {

void add_about(CLI::App& program) {
  auto* command = program.add_subcommand("about", "Show the version and the libraries it was built with");
  command->footer("Example: invar about\nExit status: 0");
  auto as_json = std::make_shared<bool>(false);
  command->add_flag("--json", *as_json, "print it as JSON");
  command->callback([as_json] {
    const auto version = [](int major, int minor, int micro) {
      return std::to_string(major) + '.' + std::to_string(minor) + '.' + std::to_string(micro);
    };
    const std::pair<std::string, std::string> parts[] = {
        {"invar", INVAR_VERSION},
        {"Fast DDS", version(FASTRTPS_VERSION_MAJOR, FASTRTPS_VERSION_MINOR, FASTRTPS_VERSION_MICRO)},
        {"Eigen", version(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
        {"OpenCV", CV_VERSION}};
    nlohmann::ordered_json json;
    for (const auto& [name, number] : parts) {
      json[name] = number;
      if (!*as_json) std::cout << name << ' ' << number << '\n';
    }
    if (*as_json) std::cout << json.dump(2) << '\n';
  });
}

}  // namespace invar::tools
