// ReceivedModels: the models that a process was sent, as files that its components may load.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace invar::dds {

/// One file a text, named by it, so that the same model sent again takes no more room; of many the oldest go. One thread.
class ReceivedModels {
 public:
  /// `folder` is made with the first model; empty: none is taken.
  explicit ReceivedModels(std::filesystem::path folder) : folder_{std::move(folder)} {}

  struct Kept {
    std::filesystem::path file;
    std::string refusal;  // empty: it is there
  };
  [[nodiscard]] Kept keep(std::span<const std::uint8_t> bytes) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace invar::dds
