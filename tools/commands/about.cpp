// `invar about`: version, build and the libraries it stands on.
#include <fastdds/rtps/attributes/RTPSParticipantAttributes.h>

#include <Eigen/Core>
#include <iostream>
#include <opencv2/core/version.hpp>

#include "tools/command.hpp"

namespace invar::tools {

void add_about(CLI::App& program) {
  auto* command = program.add_subcommand("about", "Show the version and the libraries it was built with");
  command->footer("Example: invar about");
  command->callback([] {
    std::cout << "invar " INVAR_VERSION "\n"
              << "Fast DDS " << FASTRTPS_VERSION_MAJOR << '.' << FASTRTPS_VERSION_MINOR << '.'
              << FASTRTPS_VERSION_MICRO << "\nEigen " << EIGEN_WORLD_VERSION << '.' << EIGEN_MAJOR_VERSION
              << '.' << EIGEN_MINOR_VERSION << "\nOpenCV " << CV_VERSION << '\n';
  });
}

}  // namespace invar::tools
