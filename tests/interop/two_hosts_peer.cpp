// One of two hosts: `two_hosts_peer writer|reader ADDRESS`. The writer's loop publishes the state of two axes at 500 Hz
// and a temperature; the reader waits for 400 states and the temperature, then commands a stop, which ends the writer.
#include <atomic>
#include <iostream>
#include <string>

#include "idl/types.hpp"
#include "tests/unit/dds/domain.hpp"

using namespace invar;

namespace {

dds::NodeOptions options(const std::string& role, const std::string& address) {
  dds::NodeOptions o;
  o.cell = "two-hosts";
  o.process = role;
  o.domain = 7;
  o.addresses = {address};
  return o;
}

int write(dds::Node& node) {
  auto state = node.writer<stage::AxisState>("cell/two-hosts/axis/state", "realtime");
  auto heat = node.writer<thermal::NodeTemperature>("cell/two-hosts/heat/node", "state");
  std::atomic<bool> stopped{false};
  const auto reader =
      node.reader<stage::AxisCommand>("cell/two-hosts/axis/command", "command",
                                      [&](const auto& c) { stopped = c.kind() == stage::AXIS_COMMAND_STOP; });
  thermal::NodeTemperature temperature;
  temperature.temperature(30.5);
  heat.write(temperature);
  stage::AxisState sample;
  const bool ended = dds::testing::eventually([&] {
    sample.at().cycle(sample.at().cycle() + 1);
    for (const std::uint32_t axis : {0U, 1U}) {
      sample.axis(axis);
      sample.position(1e-3 * static_cast<double>(sample.at().cycle() + axis));
      state.write(sample);
    }
    return stopped.load();
  });
  return ended ? 0 : 1;
}

int read(dds::Node& node) {
  auto command = node.writer<stage::AxisCommand>("cell/two-hosts/axis/command", "command");
  std::atomic<int> states{0}, wrong{0};
  std::atomic<bool> warm{false};
  const auto first =
      node.reader<stage::AxisState>("cell/two-hosts/axis/state", "realtime", [&](const auto& s) {
        if (s.position() != 1e-3 * static_cast<double>(s.at().cycle() + s.axis())) ++wrong;
        ++states;
      });
  const auto second = node.reader<thermal::NodeTemperature>(
      "cell/two-hosts/heat/node", "state", [&](const auto& t) { warm = t.temperature() == 30.5; });
  const bool enough =
      dds::testing::eventually([&] { return states >= 400 && warm && command.connection().matched() > 0; });
  stage::AxisCommand stop;
  stop.kind(stage::AXIS_COMMAND_STOP);
  command.write(stop);
  (void)command.connection().wait_for_acknowledgments(Duration::milliseconds(5000));
  std::cout << (states >= 400 ? "states" : "too few states") << ", "
            << (warm ? "temperature" : "no temperature") << ", " << wrong << " wrong\n";
  return enough && wrong == 0 ? 0 : 1;
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) return 2;
  dds::Node node{options(words[1], words[2]), dds::standard_profiles()};
  return std::string{words[1]} == "writer" ? write(node) : read(node);
}
