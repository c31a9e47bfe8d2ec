// `invar calibrate KIND` and `invar predict`: what each kind of calibration brings.
#pragma once

#include <CLI/CLI.hpp>

#include "core/config/yaml.hpp"
#include "core/recording/table.hpp"

namespace invar::tools {

/// A compensation.yaml begins with `invar_compensation: 1` and `kind: NAME`; `predict` looks its kind up
/// here. Evaluates the model at every row of `inputs`: one output row per input row, in order. Must read
/// every key of the model it needs, call `model.finish()`, and throw InputError for what is wrong with either
/// file.
using Predict = recording::Table (*)(const config::Yaml& model, const recording::Table& inputs);

// One file each: tools/commands/calibrate_KIND.cpp. The first adds the subcommand to the group.
void add_calibrate_dispenser(CLI::App& group);
recording::Table predict_dispenser(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_fusion(CLI::App& group);
recording::Table predict_fusion(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_thermal(CLI::App& group);
recording::Table predict_thermal(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_thermistor(CLI::App& group);
recording::Table predict_thermistor(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_geometric(CLI::App& group);
void add_calibrate_plan(CLI::App& group);
void add_calibrate_controller(CLI::App& group);
recording::Table predict_rotary(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_geometric(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_components(CLI::App& group);
recording::Table predict_components(const config::Yaml& model, const recording::Table& inputs);
void add_calibrate_camera(CLI::App& group);
void add_calibrate_ripple(CLI::App& group);
void add_calibrate_history(CLI::App& group);

}  // namespace invar::tools
