// `invar predict`: evaluates any compensation model on a table of inputs.
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "tools/calibration/predict.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"

namespace invar::tools {

namespace {

const std::map<std::string, Predict>& kinds() {
  static const std::map<std::string, Predict> table{
      {"components", predict_components}, {"dispenser", predict_dispenser},
      {"fusion", predict_fusion},         {"thermal", predict_thermal},
      {"thermistor", predict_thermistor}, {"geometric", predict_geometric},
      {"rotary", predict_rotary},
  };
  return table;
}

struct PredictOptions {
  std::filesystem::path model;
  std::filesystem::path inputs;
  std::filesystem::path output;
};

void predict(const PredictOptions& options) {
  const auto model = config::Yaml::load(options.model);
  (void)model.root().integer("invar_compensation", 1, 1);
  const std::string kind = model.root().text("kind");
  const auto found = kinds().find(kind);
  if (found == kinds().end()) {
    std::string known;
    for (const auto& [name, function] : kinds()) known += (known.empty() ? "" : ", ") + name;
    throw InputError{model.root()["kind"].where(), "`" + kind + "` is no kind of compensation",
                     "use one of: " + known};
  }
  const auto inputs = recording::Table::read(options.inputs, {"run", "line"});
  found->second(model, inputs).write(options.output);
}

}  // namespace

void add_predict(CLI::App& program) {
  auto* command = program.add_subcommand("predict", "Evaluate a compensation model on a table of inputs");
  command->footer(
      "Example: invar predict --model result/compensation.yaml --inputs points.csv --output predicted.csv\n"
      "Columns that a table needs and columns that are written, by the kind of the model:\n"
      "  geometric, components  x, y, z [m] of the machine's axes -> error_x, error_y, error_z and their "
      "sigma_x ...\n"
      "  rotary                 a, b or c [rad, deg] -> error_c, sigma_c [rad]\n"
      "  thermal                x [m], temperature [degC] -> error, sigma\n"
      "  dispenser              target_x, target_y, height [m] -> command_x, command_y (where to aim), "
      "offset_x, ...\n"
      "  fusion                 t [s], the sensors' columns of its recording -> position, sigma, the "
      "weights\n"
      "  thermistor             resistance [ohm] -> temperature\n"
      "A model of heating rates, zones or a noise level needs those columns too. An infinite sigma: not "
      "known from the\n"
      "data. Exit status: 0; 2 a file is unusable.");
  auto options = std::make_shared<PredictOptions>();
  command->add_option("--model", options->model, "compensation.yaml of any kind")->required();
  command->add_option("--inputs", options->inputs, "table of inputs, .csv or .csv.gz")->required();
  command->add_option("--output", options->output, "table to write: one row per input row")->required();
  command->callback([options] { predict(*options); });
}

}  // namespace invar::tools
