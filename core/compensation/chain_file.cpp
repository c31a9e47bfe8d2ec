#include "core/compensation/chain_file.hpp"

#include <algorithm>
#include <string>

#include "core/base/index.hpp"

namespace invar::compensation {

using metrology::squareness_count;

namespace {

constexpr double most_reversal = 1e-2;  // m, beyond it a model is refused

}  // namespace

void write_chain(ModelText& text, const metrology::Chain& chain, const std::array<Range, 3>& travel,
                 const Eigen::Vector3d& tool) {
  std::string letters;
  for (int i = 0; i < chain.axes; ++i) letters += metrology::axis_letter(chain.order[index(i)]);
  text.text("chain", letters);
  text.open("travel");
  for (int k = 0; k < 3; ++k)
    if (chain.has(k)) text.range(metrology::axis_letter(k), travel[index(k)]);
  text.close();
  text.numbers("tool", tool.data(), 3);
}

void read_chain(const config::Node& root, metrology::Chain& chain, std::array<Range, 3>& travel,
                Eigen::Vector3d& tool) {
  const config::Node node = root.required("chain");
  const std::string letters = node.as_text();
  chain.axes = 0;
  for (const char c : letters) {
    const auto axis = metrology::axis_named(std::string(1, c));
    if (!axis || chain.has(*axis) || chain.axes == 3) {
      node.fault("`" + letters + "` is no chain of axes", "write for example yxz");
      break;
    }
    chain.order[index(chain.axes++)] = *axis;
  }
  const config::Node lengths = root.required("travel");
  for (int k = 0; k < 3; ++k)
    if (chain.has(k)) travel[index(k)] = lengths.required(metrology::axis_letter(k)).as_range("m");
  const auto offset = exactly(root.required("tool"), 3, "m");
  tool = {offset[0], offset[1], offset[2]};
}

void write_squareness(ModelText& text, const metrology::Squareness& squareness,
                      const metrology::Squareness& sigma) {
  if (std::all_of(sigma.begin(), sigma.end(), [](double each) { return each <= 0.0; })) return;
  text.open("squareness");
  for (int pair = 0; pair < squareness_count; ++pair) {
    if (sigma[index(pair)] <= 0.0) continue;
    text.open(std::string{metrology::squareness_iso_name(pair)});
    text.number("value", metrology::squareness_angle_from_cosine(pair, squareness[index(pair)]))
        .text("unit", "rad");
    text.number("sigma", sigma[index(pair)]).close();
  }
  text.close();
}

void read_squareness(const config::Node& root, metrology::Squareness& squareness,
                     metrology::Squareness& sigma) {
  const config::Node node = root["squareness"];
  for (int pair = 0; pair < squareness_count; ++pair) {
    const config::Node one = node[metrology::squareness_iso_name(pair)];
    if (!one.exists()) continue;
    const auto quantity = one.as_quantity("rad", {-0.1, 0.1});
    squareness[index(pair)] = metrology::squareness_cosine_from_angle(pair, quantity.value);
    sigma[index(pair)] = quantity.sigma.value_or(0.0);
  }
}

void write_curve(ModelText& text, const std::string& key, const metrology::ReversalCurve& curve) {
  text.open(key).range("interval", curve.spline.interval());
  text.numbers("coefficients", curve.coefficients).numbers("sigma", curve.sigma).close();
}

metrology::ReversalCurve read_curve(const config::Node& node, const char* unit, double largest) {
  const Range interval = node.required("interval").as_range(unit);
  const auto values = node.required("coefficients").as_numbers(unit);
  if (values.size() < 4 || values.size() > 1000 || !(interval.width() > 0.0)) {
    node["coefficients"].fault("holds " + std::to_string(values.size()) + " numbers",
                               "a spline has 4 to 1000");
    return {};
  }
  if (!std::all_of(values.begin(), values.end(), [&](double v) { return std::abs(v) <= largest; })) {
    node["coefficients"].fault("a reversal beyond 10 " + std::string{unit[0] == 'm' ? "mm" : "mrad"},
                               "calibrate again");
    return {};
  }
  const auto sigma = exactly(node.required("sigma"), values.size() - 2, unit);
  return {numerics::CubicBSpline{interval, static_cast<int>(values.size()) - 3},
          Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<long>(values.size())),
          Eigen::Map<const Eigen::VectorXd>(sigma.data(), static_cast<long>(sigma.size()))};
}

void write_reversal(ModelText& text, const std::array<metrology::ReversalCurve, 3>& reversal) {
  std::array<double, 3> means{};
  for (std::size_t k = 0; k < 3; ++k) means[k] = reversal[k].mean();
  text.comment(
      "Lost motion of each axis [m], forward minus backward: mean over the travel, then over position");
  text.comment(
      "(cubic B-splines, the standard deviation at each knot); half of it to either side of the error.");
  text.numbers("reversal", means.data(), 3);
  if (std::all_of(reversal.begin(), reversal.end(), [](const auto& curve) { return curve.empty(); })) return;
  text.open("reversal_over_position");
  for (int k = 0; k < 3; ++k) {
    const metrology::ReversalCurve& curve = reversal[index(k)];
    if (curve.empty()) continue;
    write_curve(text, metrology::axis_letter(k), curve);
  }
  text.close();
}

void read_reversal(const config::Node& root, const metrology::Chain& chain,
                   const std::array<Range, 3>& travel, std::array<metrology::ReversalCurve, 3>& reversal) {
  const Range allowed{-most_reversal, most_reversal};
  const auto means = exactly(root.required("reversal"), 3, "m");
  const config::Node curves = root["reversal_over_position"];
  for (int k = 0; k < 3; ++k) {
    const config::Node one = curves[metrology::axis_letter(k)];
    if (!chain.has(k)) {
      if (one.exists()) one.fault("the chain has no such axis", "remove it");
      continue;
    }
    if (!one.exists()) {
      if (!allowed.contains(means[index(k)]))
        root["reversal"].fault("a reversal beyond 10 mm", "calibrate again");
      else if (means[index(k)] != 0.0)
        reversal[index(k)] = metrology::constant_reversal(travel[index(k)], means[index(k)], 0.0);
      continue;
    }
    reversal[index(k)] = read_curve(one, "m", most_reversal);
  }
}

}  // namespace invar::compensation
