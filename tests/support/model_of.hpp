// A model written in a test.
#pragma once

#include <string>

#include "core/config/yaml.hpp"
#include "core/model/model_file.hpp"

namespace invar::test {

inline physics::Model model_of(const std::string& text) {
  const auto yaml = config::Yaml::parse(text, "model.yaml");
  auto model = model::read(yaml);
  yaml.finish();
  return model;
}

}  // namespace invar::test
