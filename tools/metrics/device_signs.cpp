#include "tools/metrics/device_signs.hpp"

#include <array>

#include "core/base/clock.hpp"

namespace invar::tools {

namespace {

constexpr std::array types{"invar::stage::AxisState", "invar::thermal::NodeTemperature",
                           "invar::dispensing::PressureState", "invar::recorder::RecorderStatus"};
constexpr std::size_t most = 1000;  // of each kind: a flood of keys takes no more memory
constexpr Duration kept = Duration::seconds(30.0);

template <class Sample>
void forget_old(Signs<Sample>& signs) {
  const Instant now = monotonic_now();
  std::erase_if(signs, [&](const auto& entry) { return now - entry.second.second > kept; });
}

}  // namespace

bool DeviceSigns::tells(const std::string& type) {
  return std::find(types.begin(), types.end(), type) != types.end();
}

template <class Sample>
std::unique_ptr<dds::Inlet> DeviceSigns::inlet(const std::string& topic, Signs<Sample>& signs,
                                               std::uint32_t (*part)(const Sample&), std::uint32_t cell) {
  return dds::WireTypes::all()
      .find(typeid(Sample))
      ->attach(
          [topic, &signs, part, cell](const void* taken, Instant) {
            const auto& sample = *static_cast<const Sample*>(taken);
            const std::pair key{topic, part(sample)};
            if (sample.cell() != cell || (signs.size() >= most && !signs.contains(key))) return;
            signs[key] = {sample, monotonic_now()};
          },
          false);
}

void DeviceSigns::take(const std::string& topic, const std::string& type, std::uint32_t cell,
                       const dds::RawSample& sample) {
  const std::lock_guard lock{mutex_};
  auto& inlet = inlets_[topic];
  if (!inlet && type == types[0])
    inlet = this->inlet<stage::AxisState>(
        topic, seen_.axes, [](const auto& s) { return s.axis(); }, cell);
  else if (!inlet && type == types[1])
    inlet = this->inlet<thermal::NodeTemperature>(
        topic, seen_.heaters, [](const auto& s) { return s.node(); }, cell);
  else if (!inlet && type == types[2])
    inlet = this->inlet<dispensing::PressureState>(
        topic, seen_.pressures, [](const auto& s) { return s.node(); }, cell);
  else if (!inlet && type == types[3])
    inlet = this->inlet<recorder::RecorderStatus>(
        topic, seen_.recorders, [](const auto& s) { return s.component_id(); }, cell);
  if (inlet) (void)inlet->deliver(sample.cdr, utc_now(), std::string{sample.writer});
}

DeviceSigns::Seen DeviceSigns::seen() {
  const std::lock_guard lock{mutex_};
  forget_old(seen_.axes);
  forget_old(seen_.heaters);
  forget_old(seen_.pressures);
  forget_old(seen_.recorders);
  return seen_;
}

}  // namespace invar::tools
