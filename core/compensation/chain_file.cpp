#include "core/compensation/chain_file.hpp"

#include <algorithm>
#include <string>

namespace invar::compensation {

using metrology::squareness_count;

namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }
std::string letter(int axis) { return std::string(1, metrology::axis_letters[index(axis)]); }

}  // namespace

void write_chain(ModelText& text, const metrology::Chain& chain, const std::array<Range, 3>& travel,
                 const Eigen::Vector3d& tool) {
  std::string letters;
  for (int i = 0; i < chain.axes; ++i) letters += letter(chain.order[index(i)]);
  text.text("chain", letters);
  text.open("travel");
  for (int k = 0; k < 3; ++k)
    if (chain.has(k)) text.range(letter(k), travel[index(k)]);
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
    if (chain.has(k)) travel[index(k)] = lengths.required(letter(k)).as_range("m");
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

}  // namespace invar::compensation
