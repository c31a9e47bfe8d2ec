// Recorder: writes what the cell says to an MCAP file, with a ledger of what was lost.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "core/component/parameters.hpp"
#include "core/component/port.hpp"
#include "core/recording/recording_writer.hpp"
#include "idl/recorder.h"

namespace invar::recorder {

/// A topic to record.
struct Source {
  std::string topic;
  std::string type;     // a::b::T
  std::string profile;  // name of its QoS
  std::string idl;      // self-contained text that defines the type
};

/// Writes samples as they travel, in CDR. The process that runs it knows the cell's topics and hands the samples over:
/// `is_wanted` selects topics, `record` takes a sample. A full disk is an error of the component, and so is
/// one whose free space falls to the reserve: the recording ends whole, and black boxes still find room. A notice, at most every
/// ten seconds, says how many samples are lost because the recorder is slower than the cell. Not real-time.
class Recorder final : public Component {
 public:
  struct Parameters {
    std::string out = "out";
    std::string name = "recording.mcap";
    std::vector<std::string> topics;
    std::int64_t reserve_mb = 64;  // some thirty black boxes of a loop at 1 kHz
    void describe(auto& p) {
      p(out, "out", "folder for the file, created; relative to where the cell was started");
      p(name, "name", "name of the file");
      if constexpr (requires { p.node(); }) {
        check_folder(p.node(), "out", out);
        if (name.empty() || name == "." || name == ".." || std::filesystem::path{name}.filename() != name)
          p.node()["name"].fault("`" + name + "` is no name of a file",
                                 "write a name alone, as recording.mcap; `out` names the folder");
      }
      p(topics, "topics", "only topics that contain one of these texts; none: all of the cell");
      p(reserve_mb, "reserve_mb", 0, 1'000'000,
        "free space [MB] at which recording ends, left on the disk for black boxes");
    }
  };
  explicit Recorder(const Parameters& parameters) : parameters_{parameters} {}
  [[nodiscard]] std::vector<Claim> claims() const override {
    return {{"the file " + file().lexically_normal().string(), "name", true}};
  }
  void configure() override;
  void cleanup() noexcept override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

  [[nodiscard]] std::filesystem::path file() const {
    return std::filesystem::path{parameters_.out} / parameters_.name;
  }
  [[nodiscard]] bool is_wanted(const std::string& topic) const;
  /// Any thread: one sample of one writer. `sequence` counts that writer's samples from 1. Readers hear what others have kept for
  /// them before the component is configured for the first time: up to 16 MB wait for it. Later, nothing is written unless the
  /// component is configured.
  void record(const Source& source, const std::string& writer, std::uint64_t sequence, Instant sent,
              Instant received, std::span<const std::byte> cdr);
  /// Set-up, after configure: a file that belongs to the recording.
  void attach(const std::filesystem::path& file);

 private:
  struct Origin {  // of a sample, as `record` has it: nothing is copied
    const Source& source;
    const std::string& writer;
    std::uint64_t sequence;
    Instant sent, received;
  };
  struct Early {
    Source source;
    std::string writer;
    std::uint64_t sequence = 0;
    Instant sent, received;
    std::vector<std::byte> cdr;
  };
  void write(const Origin& origin, std::span<const std::byte> cdr);
  void say_status() noexcept;
  void say_lost() noexcept;

  const Parameters& parameters_;
  Notices notices_{*this};
  Output<RecorderStatus> status_{*this, "status", "state"};
  std::uint64_t told_lost_ = 0;
  Instant look_at_, status_at_;
  std::mutex mutex_;
  std::unique_ptr<recording::RecordingWriter> writer_;
  std::vector<Early> early_;  // before it was configured for the first time
  std::size_t early_bytes_ = 0;
  bool was_open_ = false;
  Instant newest_;                                                         // when the last sample was taken
  std::map<std::pair<std::string, std::string>, std::uint16_t> channels_;  // by topic and writer
};

}  // namespace invar::recorder
