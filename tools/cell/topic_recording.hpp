// TopicRecording: the topics of a cell, read as they travel and handed to its recorder.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "components/recorder/recorder.hpp"
#include "core/component/port.hpp"
#include "core/dds/node.hpp"
#include "core/dds/simulated_clock.hpp"
#include "core/executor/executor.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

class TopicRecording {
 public:
  TopicRecording(recorder::Recorder& recorder, dds::Node& node) : recorder_{recorder}, node_{node} {}

  /// By the clock, before the node starts: every output of the cell, those of this process from `executor`.
  void read_all(const LoadedCell& loaded, Executor& executor);
  /// In simulated time: a sample as it is delivered.
  void take(const dds::LockstepSample& sample);
  /// Before the node stops.
  void end() { connections_.clear(); }

 private:
  void read(const Port& port);

  recorder::Recorder& recorder_;
  dds::Node& node_;
  std::set<std::string> read_;  // topics
  std::vector<std::unique_ptr<dds::Connection>> connections_;
};

}  // namespace invar::tools
