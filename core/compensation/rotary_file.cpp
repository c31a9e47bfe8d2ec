#include "core/compensation/rotary_file.hpp"

#include <string>

#include "core/compensation/chain_file.hpp"
#include "core/compensation/fusion_file.hpp"

namespace invar::compensation {

namespace {

constexpr double most_rotary_reversal = 1e-2;  // rad, beyond it a model is refused
constexpr const char* whole_turns = "whole turns are taken off";
constexpr const char* held = "end values are held";

}  // namespace

void write_rotary(ModelText& text, const metrology::RotaryAxis& axis) {
  text.comment("Error = actual minus commanded angle [rad], by ISO 230-1 " +
               std::string{axis.letter == 'a'   ? "EAA"
                           : axis.letter == 'b' ? "EBB"
                                                : "ECC"} +
               ".");
  text.text("axis", std::string(1, axis.letter)).text("unit", "rad").range("travel", axis.travel);
  text.text("outside", axis.comes_round ? whole_turns : held);
  text.comment("Gaussian network over the angle, mean of both directions; `sigma` inside its range.");
  text.number("sigma", axis.error.sigma).number("slope", axis.error.slope);
  write_network(text, "error", axis.error.network);
  if (axis.reversal.empty()) return;
  text.comment("Reversal, forward minus backward: half of it to either side of the error.");
  write_curve(text, "reversal", axis.reversal);
}

metrology::RotaryAxis read_rotary(const config::Node& root) {
  root["identified_from"].accept_all();
  metrology::RotaryAxis axis;
  const std::string letter = root.choice("axis", {"a", "b", "c"});
  axis.letter = letter.empty() ? 'c' : letter[0];
  (void)root.choice("unit", {"rad"});
  axis.travel = root.required("travel").as_range("rad");
  axis.comes_round = root.choice("outside", {whole_turns, held}) == whole_turns;
  axis.error.sigma = root.number("sigma", "rad", Range::not_negative());
  axis.error.slope = root.number("slope", "rad", Range::not_negative());
  axis.error.network = read_network(root.required("error"));
  if (axis.error.network.inputs() != 1)
    root["error"].fault("has more inputs than the angle", "calibrate again");
  if (root.has("reversal")) axis.reversal = read_curve(root["reversal"], "rad", most_rotary_reversal);
  return axis;
}

metrology::RotaryAxis load_rotary(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"rotary"});
  check_seal(yaml);
  auto axis = read_rotary(yaml.root());
  yaml.finish();
  return axis;
}

}  // namespace invar::compensation
