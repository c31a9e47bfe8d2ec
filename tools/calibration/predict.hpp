// `invar predict`: a compensation.yaml evaluated at rows, by kind.
#pragma once

#include "core/config/yaml.hpp"
#include "core/recording/table.hpp"

namespace invar::tools {

/// A compensation.yaml begins with `invar_compensation: 1` and `kind: NAME`; `predict` looks its kind up
/// here. Evaluates the model at every row of `inputs`: one output row per input row, in order. Must read
/// every key of the model it needs, call `model.finish()`, and throw InputError for what is wrong with either
/// file.
using Predict = recording::Table (*)(const config::Yaml& model, const recording::Table& inputs);

recording::Table predict_dispenser(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_fusion(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_thermal(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_thermistor(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_rotary(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_geometric(const config::Yaml& model, const recording::Table& inputs);
recording::Table predict_components(const config::Yaml& model, const recording::Table& inputs);

}  // namespace invar::tools
