// The fusion models as a file, and the estimator that the file asks for.
#pragma once

#include <memory>
#include <string>

#include "core/compensation/model_file.hpp"
#include "core/metrology/fusion/sensor_fusion.hpp"
#include "core/metrology/fusion/weighted_fusion.hpp"

namespace invar::compensation {

/// Both estimators are stored; `method` ("observer" or "weights") is the one to use.
struct FusionFile {
  std::string method = "observer";
  bool noise_given = true;  // the selector `noise_level` is a column; otherwise it is estimated
  metrology::FusionModel sensors;
  metrology::WeightModel weights;
  std::string selector;  // the further attribute of the weights; empty: none
};

void write_fusion(ModelText& text, const FusionFile& model);

/// Reads what `write_fusion` wrote. Faults go to the document's list; the caller ends with `finish`.
FusionFile read_fusion(const config::Node& root);

/// The estimator of the file's method; `learning` is of weights alone, an observer follows its sensors by itself. Set-up only;
/// its `step` is real-time.
std::unique_ptr<metrology::FusionEstimator> make_estimator(const FusionFile& model,
                                                           const metrology::WeightLearning& learning = {});

/// A network in a file of any kind: units are those of the surrounding keys.
void write_network(ModelText& text, const std::string& key, const numerics::RbfNetwork& network);
numerics::RbfNetwork read_network(const config::Node& node);

}  // namespace invar::compensation
