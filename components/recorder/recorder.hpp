// Recorder: writes what the cell says to an MCAP file, with a ledger of what was lost.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/recording/recording_writer.hpp"

namespace invar::recorder {

/// What the recorder writes; the process that runs it connects it to the middleware.
class Recorder final : public Component {
 public:
  struct Parameters {
    std::string out = "out";
    std::string name = "recording.mcap";
    std::vector<std::string> topics;
    void describe(auto& p) {
      p(out, "out", "folder for the file, created; relative to where the cell was started");
      p(name, "name", "of the file");
      p(topics, "topics", "only topics that contain one of these texts; none: all of the cell");
    }
  };
  explicit Recorder(const Parameters& parameters) : parameters_{parameters} {}
  void configure() override;
  void cleanup() noexcept override;
  void step(const Tick& tick) noexcept override;

 private:
  const Parameters& parameters_;
  std::unique_ptr<recording::RecordingWriter> writer_;
};

}  // namespace invar::recorder
