// DeviceSigns: the newest sample of each axis, heater, pressure controller and recorder of a cell.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "core/base/time.hpp"
#include "core/dds/node.hpp"
#include "core/dds/wire_type.hpp"
#include "idl/dispensing.h"
#include "idl/recorder.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::tools {

/// By topic, and axis, node or component within it.
template <class Sample>
using Signs = std::map<std::pair<std::string, std::uint32_t>, std::pair<Sample, Instant>>;

/// Any thread.
class DeviceSigns {
 public:
  struct Seen {
    Signs<stage::AxisState> axes;
    Signs<thermal::NodeTemperature> heaters;
    Signs<dispensing::PressureState> pressures;
    Signs<recorder::RecorderStatus> recorders;
  };
  /// Whether samples of this type are kept.
  [[nodiscard]] static bool tells(const std::string& type);
  /// A sample of a topic that `tells`; one that does not decode, or of another cell, is passed over.
  void take(const std::string& topic, const std::string& type, std::uint32_t cell,
            const dds::RawSample& sample);
  /// Samples of the last half minute.
  [[nodiscard]] Seen seen();

 private:
  template <class Sample>
  std::unique_ptr<dds::Inlet> inlet(const std::string& topic, Signs<Sample>& signs,
                                    std::uint32_t (*part)(const Sample&), std::uint32_t cell);

  std::mutex mutex_;
  Seen seen_;
  std::map<std::string, std::unique_ptr<dds::Inlet>> inlets_;  // by topic
};

}  // namespace invar::tools
