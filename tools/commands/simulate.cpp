// `invar simulate`: runs a model on the input columns alone and writes its outputs.
#include <filesystem>
#include <memory>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "tools/command.hpp"

namespace invar::tools {

namespace {

struct Options {
  std::filesystem::path model;
  std::filesystem::path inputs;
  std::filesystem::path output;
};

void simulate(const Options& options) {
  const auto model = model::load(options.model);
  const auto table = model::read_recording(options.inputs, model).front();
  const auto inputs = model::to_record(table, model, false);
  model::check_order(inputs.record, options.inputs);
  physics::Outputs outputs;
  physics::prepare(model, inputs.record)->run(model, outputs);
  model::to_table(model, inputs, outputs).write(options.output);
}

}  // namespace

void add_simulate(CLI::App& program) {
  auto* command = program.add_subcommand("simulate", "Run a model on the input columns of a recording");
  command->footer(
      "Example: invar simulate --model model.yaml --inputs test_inputs.csv.gz --output simulated.csv");
  auto options = std::make_shared<Options>();
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
