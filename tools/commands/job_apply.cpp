// `invar job apply`: a model into a running component - a diagnosis's into a stage, which feeds forward its forces, a
// dispenser or the compensation; a calibration's into the compensation or the dispenser - or out of it.
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "core/compensation/droplet_model.hpp"
#include "core/compensation/error_map_model.hpp"
#include "core/compensation/model_file.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/axis_feedforward.hpp"
#include "idl/compensation.h"
#include "tools/commands/job.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;

struct JobApplyOptions {
  JobApplyOptions(CLI::App& command, std::vector<Word> words) : call{command, std::move(words)} {}
  CellCall call;
  std::filesystem::path model;
  bool rollback = false;
  bool none = false;
  bool partly = false;
  bool json = false;
};

/// Which type of component takes a model of a plant; empty: none, and what to do instead.
struct Taker {
  physics::Plant plant;
  std::string_view type, otherwise;
};
constexpr Taker takers[] = {
    {physics::Plant::axis, "stage", ""},
    {physics::Plant::droplet, "dispenser", ""},
    {physics::Plant::error_map, "compensation", ""},
    {physics::Plant::sensor, "", "give fusion what `invar calibrate fusion` makes of the same readings"},
    {physics::Plant::thermal, "",
     "the component thermal has gains, no model; `invar simulate` runs this one"},
    {physics::Plant::equations, "", "`invar simulate` runs it"}};

/// Why the component that takes it has no use for a term, in words that follow on what it cannot do; empty: it has.
std::string why_not_used(const physics::Term& term, physics::Plant plant) {
  const bool axis = plant == physics::Plant::axis, map = plant == physics::Plant::error_map;
  const std::string_view why = axis  ? physics::why_not_fed_forward(term)
                               : map ? compensation::why_not_corrected(term)
                                     : compensation::why_not_aimed_by(term);
  if (why.empty()) return {};
  const std::string name = "`" + std::string{term.info->name} + "`";
  return (axis  ? "a stage cannot feed " + name + " forward: "
          : map ? "compensation cannot correct " + name + ": "
                : "a dispenser cannot aim by " + name + ": ") +
         std::string{why};
}

/// For whom a file is.
struct Addressee {
  std::string_view type;    // of component; empty: the cell decides
  std::string recorded_of;  // the component whose recording its columns read; empty: none that is known
};

/// The file's faults are said here, before anything is asked of the cell.
Addressee check_model(const std::filesystem::path& file, bool partly) {
  const auto yaml = config::Yaml::load(file);
  if (yaml.root().has("invar_compensation")) {
    if (compensation::check_seal(yaml) == 0)
      throw InputError{file.string(), "carries no checksum", "apply a file as a calibration wrote it"};
    return {};
  }
  const auto model = model::read(yaml);
  yaml.finish();
  const auto& taker = *std::find_if(std::begin(takers), std::end(takers),
                                    [&](const Taker& one) { return one.plant == model.plant; });
  if (taker.type.empty())
    throw InputError{
        file.string(),
        "is of plant " + std::string{physics::name_of(model.plant)} + ", which no component takes",
        std::string{taker.otherwise}};
  std::vector<Fault> faults;
  for (std::size_t i = 0; i < model.terms.size(); ++i)
    if (const auto why = why_not_used(model.terms[i], model.plant); !why.empty() && !partly)
      faults.push_back({file.string() + ": terms[" + std::to_string(i) + "]", why,
                        "take it out, or give --partly for the rest"});
  if (!faults.empty()) throw InputError{faults};
  if (model.plant == physics::Plant::error_map)
    if (const auto why = compensation::why_not_corrected(model); !why.empty())
      throw InputError{file.string(), "cannot be corrected by: " + why, "then apply it again"};
  const auto* position = model.signal("position");
  return {taker.type, position == nullptr ? "" : position->column.substr(0, position->column.find('.'))};
}

/// A model for a component of another type, or of another stage than this one.
void check_addressee(const config::Cell& cell, const std::string& name, const Addressee& of,
                     const std::filesystem::path& file) {
  const auto* component = cell.find(name);
  const auto* recorded = cell.find(of.recorded_of);
  if (component->type == "stage" && of.type == "stage" && recorded != nullptr && recorded != component &&
      recorded->type == "stage")
    throw InputError{file.string() + ": columns",
                     "read what `" + of.recorded_of + "` recorded, not `" + name + "`",
                     "give it to " + of.recorded_of + ", or where both are known to be alike write " + name +
                         " in its columns"};
  const auto type = of.type;
  if (type.empty() || component->type == type || component->type == "model_watch") return;
  std::string list;
  for (const auto& process : cell.processes)
    for (const auto& other : process.components)
      if (other.type == type) list += (list.empty() ? "" : ", ") + other.name;
  throw InputError{file.string(),
                   "is for a " + std::string{type} + "; `" + name + "` is of type " + component->type,
                   list.empty() ? "the cell has no " + std::string{type} : "give it to " + list};
}

void check_component(const config::Cell& cell, const std::string& name) {
  if (cell.find(name) != nullptr) return;
  std::vector<std::string> names;
  std::string list;
  for (const auto& process : cell.processes)
    for (const auto& component : process.components) {
      names.push_back(component.name);
      list += (list.empty() ? "" : ", ") + component.name;
    }
  const auto near = config::nearest(name, names);
  throw InputError{"COMPONENT", "`" + name + "` is no component of " + cell.file.string(),
                   near.empty() ? "there are: " + list : "did you mean `" + near + "`?"};
}

/// Orders to one component's model, and its answers.
class ModelPort {
 public:
  ModelPort(LiveCell& cell, const std::string& component)
      : cell_{cell},
        writer_{cell.node().writer<compensation::ModelCommand>(
            dds::topic_name(cell.name(), component, "model"), by_hand(cell.node().profile("command")))} {
    for (std::size_t i = 0; i < readers_.size(); ++i)  // a component whose only status it is calls it so
      readers_[i] = cell.node().reader<compensation::ModelStatus>(
          dds::topic_name(cell.name(), component, i == 0 ? "model_status" : "status"), "state",
          [this](const compensation::ModelStatus& status) {
            const std::lock_guard lock{mutex_};
            status_ = status;
          });
  }

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
    command.cell(cell_.cell_id());
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
  /// Whoever gives a model by hand outranks the component of jobs that gave one before; a component that is in the middle of
  /// a calibration says so.
  static dds::Profile by_hand(dds::Profile profile) {
    ++profile.strength;
    return profile;
  }

  LiveCell& cell_;
  dds::Writer<compensation::ModelCommand> writer_;
  std::mutex mutex_;
  std::optional<compensation::ModelStatus> status_;
  std::array<std::unique_ptr<dds::Connection>, 2> readers_;  // last: nothing arrives before all else stands
};

/// Brings the file's text to the component's process, which may be on another PC, and returns where it lies there; nothing: it
/// was refused, and said so.
std::optional<std::string> send_model(LiveCell& cell, const std::string& command,
                                      const std::string& component, const std::filesystem::path& file) {
  constexpr std::size_t most = 4U << 20U;  // of a ModelRequest
  const std::string text = config::Yaml::load(file).text();
  if (text.size() > most)
    throw InputError{file.string(), "has more than 4 MiB", "a component takes no larger model"};
  const std::string process = cell.process_of(component);
  const auto reply = cell.client().model(process, component, text, cell.patience());
  if (reply && reply->done()) return reply->path().c_str();
  std::cerr << command << ": process `" << process << "` "
            << (reply ? std::string{"refused the model: "} + reply->text().c_str()
                      : "does not answer" + cell.clocks_apart(process))
            << '\n';
  return std::nullopt;
}

std::string state_text(compensation::ModelState state) {
  constexpr std::array words{"none", "staged", "active", "refused"};
  const auto index = static_cast<std::size_t>(state);
  return index < words.size() ? words[index] : "?";
}

nlohmann::ordered_json apply_json(const std::string& component, const compensation::ModelStatus& answer,
                                  const std::filesystem::path& file) {
  return {{"component", component},
          {"state", state_text(answer.state())},
          {"model", file.string()},
          {"text", answer.text().c_str()},
          {"time_ns", answer.at().time_ns()}};
}

int apply(JobApplyOptions& options) {
  options.call.resolve();
  std::filesystem::path file;
  Addressee of;
  if (!options.rollback && !options.none) {
    if (options.model.empty())
      throw InputError{"--model", "is missing", "name the model's file, or give --rollback or --none"};
    file = std::filesystem::absolute(options.model);
    of = check_model(file, options.partly);
  }
  (void)interrupted();
  LiveCell cell{options.call};
  if (cell.file() != nullptr) {
    check_component(*cell.file(), options.call.word(0));
    check_addressee(*cell.file(), options.call.word(0), of, file);
  }
  if (!cell.found()) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  const std::string& component = options.call.word(0);
  if (const auto why = cell.too_far_behind(cell.process_of(component)); !why.empty()) {
    std::cerr << options.call.command << ": " << why << '\n';
    return 1;
  }
  if (!cell.process_of(component).empty() && !cell.wait_for_component(component)) {
    std::cerr << options.call.command << ": `" << component
              << "` is not active, and takes no model; activate it with invar lifecycle\n";
    return 1;
  }
  ModelPort port{cell, component};
  if (!port.connect()) {
    std::cerr << options.call.command << ": `" << component
              << "` takes no model; is it a stage, compensation or dispenser of this cell?\n";
    return 1;
  }
  const auto say = [&](const compensation::ModelStatus& answer, const std::string& text) {
    if (options.json)
      std::cout << apply_json(component, answer, file).dump(2) << '\n';
    else
      std::cout << component << ": " << text << '\n';
  };
  const auto refused = [&](const std::optional<compensation::ModelStatus>& answer) {
    if (answer && answer->state() != compensation::MODEL_REFUSED) return false;
    if (options.json && answer) say(*answer, "");
    std::cerr << options.call.command << ": `" << component << "` "
              << (answer ? std::string{"refused: "} + answer->text().c_str()
                         : "does not answer" + cell.clocks_apart(cell.process_of(component)))
              << '\n';
    return true;
  };
  if (options.rollback || options.none) {
    const auto answer =
        port.order(options.none ? compensation::MODEL_CLEAR : compensation::MODEL_ROLLBACK, "");
    if (refused(answer)) return 1;
    say(*answer,
        answer->state() == compensation::MODEL_NONE ? "no model any more" : "the model before is active");
    return 0;
  }
  const auto sent = send_model(cell, options.call.command, component, file);
  if (!sent) return 1;
  if (refused(port.order(compensation::MODEL_STAGE, *sent))) return 1;
  const auto active = port.order(compensation::MODEL_ACTIVATE, "");
  if (refused(active)) return 1;
  say(*active, file.string() + " is active");
  return 0;
}

}  // namespace

void add_job_apply(CLI::App& job) {
  auto* command = job.add_subcommand("apply", "Load a model into a running stage, compensation or dispenser");
  command->footer(
      "Example: invar job apply deployment/cell.yaml stage_x --model diagnosis/patched.yaml\n"
      "         invar job apply deployment/cell.yaml stage_x --rollback\n"
      "         invar job apply deployment/cell.yaml compensation --none\n"
      "A stage feeds forward the forces of an axis's model.yaml, and refuses one that leaves too little "
      "current for its servo.\n"
      "A dispenser aims by a model.yaml of plant droplet. Compensation corrects an axis by one of plant\n"
      "error_map. Compensation, dispenser and fusion take a compensation.yaml of their kind. With a folder "
      "`state`, a\n"
      "compensation starts next time with what it was given here, also with none.\n"
      "Exit status: 0 done; 1 refused or no answer; 2 a fault of the call or a file");
  auto options = std::make_shared<JobApplyOptions>(
      *command, std::vector<Word>{{"COMPONENT", "that takes it, such as stage_x"}});
  auto* model =
      command->add_option("--model", options->model,
                          "model.yaml as `invar diagnose` writes it, or a calibration's compensation.yaml");
  command->add_flag("--partly", options->partly, "leave out the terms that the component has no use for");
  command->add_flag("--json", options->json, "print the component's answer as JSON");
  auto* rollback = command->add_flag("--rollback", options->rollback, "back to the model before");
  command->add_flag("--none", options->none, "take the models out")->excludes(rollback)->excludes(model);
  command->callback([options] {
    if (const int status = apply(*options); status != 0) throw CLI::RuntimeError{status};
  });
}

}  // namespace invar::tools
