// `invar simulate`: runs a model on the input columns alone and writes its outputs.
#include <filesystem>
#include <memory>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "tools/command.hpp"
#include "tools/other_file.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

struct SimulateOptions {
  std::filesystem::path model;
  std::filesystem::path inputs;
  std::filesystem::path output;
};

/// Of a model in time each row follows from the one before, and missing inputs are bridged: no number is none ever after.
void expect_numbers(const physics::Model& model, const physics::Record& inputs,
                    const physics::Outputs& outputs, const SimulateOptions& options) {
  if (model.plant != physics::Plant::axis && model.plant != physics::Plant::thermal &&
      model.plant != physics::Plant::equations)
    return;
  const auto names = model.outputs();
  for (std::size_t o = 0; o < outputs.size(); ++o)
    if (const auto from = physics::ran_away_at(outputs[o]); from < outputs[o].size())
      throw InputError{
          options.model.string(),
          "simulated on " + options.inputs.filename().string() + ", output `" + names[o] +
              "` runs away from t = " + report::number(inputs.time[from], 6) + " s on",
          "look for a division by zero, or begin with values with which the model does not run away"};
}

void simulate(const SimulateOptions& options) {
  expect_other_file("--output", options.output, {options.model, options.inputs});
  const auto model = model::load(options.model);
  const auto table = model::read_recording(options.inputs, model).front();
  auto inputs = model::to_record(table, model, false);
  inputs.record.turn = 0.06;  // one run may take its time
  model::check_order(model, inputs.record, options.inputs);
  physics::Outputs outputs;
  physics::prepare(model, inputs.record)->run(model, outputs);
  expect_numbers(model, inputs.record, outputs, options);
  model::to_table(model, inputs, outputs).write(options.output);
}

}  // namespace

void add_simulate(CLI::App& program) {
  auto* command = program.add_subcommand("simulate", "Run a model on the input columns of a recording");
  command->footer(
      "Example: invar simulate --model model.yaml --inputs test_inputs.csv.gz --output simulated.csv");
  auto options = std::make_shared<SimulateOptions>();
  command
      ->add_option("--model", options->model,
                   "model.yaml or patched.yaml (invar diagnose --example shows one)")
      ->required();
  command->add_option("--inputs", options->inputs, "table of inputs, .csv or .csv.gz, or the cell's .mcap")
      ->required();
  command->add_option("--output", options->output, "table to write: time and outputs, one row per input row")
      ->required();
  command->callback([options] { simulate(*options); });
}

}  // namespace invar::tools
