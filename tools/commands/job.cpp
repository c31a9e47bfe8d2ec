// `invar job`: the group; each kind of undertaking is a file of its own.
#include "tools/commands/job.hpp"

#include "tools/command.hpp"

namespace invar::tools {

void add_job(CLI::App& program) {
  auto* group = program.add_subcommand(
      "job", "Run, watch and cancel the jobs of a cell; compare runs with simulations; apply a model");
  group->require_subcommand(1);
  group->footer(
      "Example: invar job run deployment/xy-table.yaml calibrate-geometry\n"
      "         invar job compare --recording recording.csv.gz --machine model.yaml\n"
      "         invar job apply deployment/cell.yaml stage_x --model diagnosis/patched.yaml");
  add_job_run(*group);
  add_job_compare(*group);
  add_job_apply(*group);
}

}  // namespace invar::tools
