// `invar job apply`: a model.yaml - what `invar diagnose` wrote - into the running stage, which feeds forward its forces.
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <random>

#include "core/model/model_file.hpp"
#include "idl/compensation.h"
#include "tools/commands/job.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  Options(CLI::App& command, std::vector<Word> words) : call{command, std::move(words)} {}
  CellCall call;
  std::filesystem::path model;
  bool rollback = false;
};

/// Orders to one component's model, and its answers.
class ModelPort {
 public:
  ModelPort(LiveCell& cell, const std::string& component)
      : cell_{cell},
        writer_{cell.node().writer<compensation::ModelCommand>(
            dds::topic_name(cell.name(), component, "model"), cell.node().profile("command"))},
        reader_{cell.node().reader<compensation::ModelStatus>(
            dds::topic_name(cell.name(), component, "model_status"), "state",
            [this](const compensation::ModelStatus& status) {
              const std::lock_guard lock{mutex_};
              status_ = status;
            })} {}

  bool connect() {
    const auto end = Clock::now() + std::chrono::nanoseconds{cell_.patience().ns};
    while (writer_.connection().matched() == 0)
      if (Clock::now() > end || !sleep_for(Duration::milliseconds(20))) return false;
    return sleep_for(Duration::milliseconds(100));  // the reader's side of the match
  }
  /// The answer to the order; none: it did not come.
  std::optional<compensation::ModelStatus> order(compensation::ModelCommandKind kind,
                                                 const std::string& path) {
    std::random_device random;
    compensation::ModelCommand command;
    if (cell_.file() != nullptr) command.cell(cell_.file()->id);
    command.id(((std::uint64_t{random()} << 32U) | random()) | 1U);
    command.kind(kind);
    command.path(path);
    writer_.write(command);
    const auto end = Clock::now() + std::chrono::nanoseconds{cell_.patience().ns};
    while (Clock::now() < end && sleep_for(Duration::milliseconds(20))) {
      const std::lock_guard lock{mutex_};
      if (status_ && status_->command_id() == command.id()) return status_;
    }
    return std::nullopt;
  }

 private:
  LiveCell& cell_;
  dds::Writer<compensation::ModelCommand> writer_;
  std::mutex mutex_;
  std::optional<compensation::ModelStatus> status_;
  std::unique_ptr<dds::Connection> reader_;  // last: nothing arrives before all else stands
};

int apply(Options& options) {
  options.call.resolve();
  std::filesystem::path file;
  if (!options.rollback) {
    if (options.model.empty())
      throw InputError{"--model", "is missing", "name the model.yaml to load, or give --rollback"};
    file = std::filesystem::absolute(options.model);
    const auto model = model::load(file);  // its faults are said here, before anything is asked of the cell
    if (model.plant != physics::Plant::axis)
      throw InputError{file.string(), "is of plant " + std::string{physics::name_of(model.plant)},
                       "a stage takes a model of plant axis"};
  }
  (void)interrupted();
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  const std::string& component = options.call.word(0);
  ModelPort port{cell, component};
  if (!port.connect()) {
    std::cerr << options.call.command << ": `" << component
              << "` takes no model; is it a stage of this cell?\n";
    return 1;
  }
  const auto refused = [&](const std::optional<compensation::ModelStatus>& answer) {
    if (answer && answer->state() != compensation::MODEL_REFUSED) return false;
    std::cerr << options.call.command << ": `" << component << "` "
              << (answer ? std::string{"refused: "} + answer->text().c_str() : "does not answer") << '\n';
    return true;
  };
  if (options.rollback) {
    const auto answer = port.order(compensation::MODEL_ROLLBACK, "");
    if (refused(answer)) return 1;
    std::cout << component
              << (answer->state() == compensation::MODEL_NONE ? ": no model any more\n"
                                                              : ": the model before is active\n");
    return 0;
  }
  if (refused(port.order(compensation::MODEL_STAGE, file.string()))) return 1;
  if (refused(port.order(compensation::MODEL_ACTIVATE, ""))) return 1;
  std::cout << component << ": " << file.string() << " is active\n";
  return 0;
}

}  // namespace

void add_job_apply(CLI::App& job) {
  auto* command =
      job.add_subcommand("apply", "Load a model.yaml into a running stage: its forces are fed forward");
  command->footer(
      "Example: invar job apply deployment/cell.yaml stage_x --model diagnosis/patched.yaml\n"
      "         invar job apply deployment/cell.yaml stage_x --rollback\n"
      "The stage refuses a model that leaves too little current for its servo.");
  auto options =
      std::make_shared<Options>(*command, std::vector<Word>{{"COMPONENT", "the stage, such as stage_x"}});
  command->add_option("--model", options->model, "model.yaml of plant axis, as `invar diagnose` writes it");
  command->add_flag("--rollback", options->rollback, "back to the model before");
  command->callback([options] {
    if (const int status = apply(*options); status != 0) throw CLI::RuntimeError{status};
  });
}

}  // namespace invar::tools
