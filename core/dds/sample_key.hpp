// ExpectedKeys: of which cell, axis, node, sensor or component an input takes samples.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace invar::dds {

struct ExpectedKeys {
  std::uint32_t cell = 0;
  bool any_cell = false;             // cell 0 too: a topic of the plant
  std::vector<std::uint32_t> parts;  // axes, nodes, sensors or components; empty: every one
};

/// Name and value of the member of the key beside `cell`; nullptr: there is none.
template <class T>
std::pair<const char*, std::uint32_t> key_part(const T& sample) {
  if constexpr (requires { sample.axis(); })
    return {"axis", sample.axis()};
  else if constexpr (requires { sample.node(); })
    return {"node", sample.node()};
  else if constexpr (requires { sample.sensor(); })
    return {"sensor", sample.sensor()};
  else if constexpr (requires { sample.component_id(); })
    return {"component_id", sample.component_id()};
  else
    return {nullptr, 0};
}

/// Whether the key of a sample is one that is taken. Any thread; allocates nothing.
template <class T>
bool has_expected_key(const T& sample, const ExpectedKeys& expected) {
  if constexpr (requires { sample.cell(); }) {
    if (sample.cell() != expected.cell && !(expected.any_cell && sample.cell() == 0)) return false;
    const auto [name, value] = key_part(sample);
    return name == nullptr || expected.parts.empty() ||
           std::find(expected.parts.begin(), expected.parts.end(), value) != expected.parts.end();
  }
  return true;
}

/// Which key came and which is taken, for people.
template <class T>
std::string told_key(const T& sample, const ExpectedKeys& expected) {
  std::string came, taken;
  if constexpr (requires { sample.cell(); }) {
    came = "cell " + std::to_string(sample.cell());
    taken = "cell " + std::to_string(expected.cell);
    if (const auto [name, value] = key_part(sample); name != nullptr) {
      came += std::string{", "} + name + " " + std::to_string(value);
      std::string list;
      for (const auto part : expected.parts) list += (list.empty() ? "" : " or ") + std::to_string(part);
      if (!list.empty()) taken += std::string{", "} + name + " " + list;
    }
  }
  return "its key is " + came + ", and this input takes " + taken +
         ": mend the key, or write to the other topic";
}

}  // namespace invar::dds
