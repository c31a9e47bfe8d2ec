// compensation.yaml: how every compensation model is written, with a checksum, and checked on reading.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/range.hpp"
#include "core/config/yaml.hpp"

namespace invar::compensation {

/// Builds the text of a model file. Numbers carry 17 digits, so that a model reads back exactly.
class ModelText {
 public:
  /// Begins with `invar_compensation: 1`, `kind: KIND` and the provenance: files with their checksums.
  ModelText(const std::string& kind, const std::vector<std::filesystem::path>& sources);

  ModelText& comment(const std::string& text);
  ModelText& open(const std::string& key);       // a map below `key`
  ModelText& open_list(const std::string& key);  // a list of maps below `key`
  ModelText& item();                             // the next map of the list
  ModelText& close();
  ModelText& number(const std::string& key, double value);
  ModelText& integer(const std::string& key, long value);
  ModelText& text(const std::string& key, const std::string& value);
  ModelText& range(const std::string& key, const Range& value);
  ModelText& numbers(const std::string& key, const double* first, std::size_t count);
  ModelText& numbers(const std::string& key, const std::vector<double>& values);
  ModelText& numbers(const std::string& key, const Eigen::Ref<const Eigen::VectorXd>& values);

  /// The text with its last line `checksum: ...` (CRC-32 of all lines above it).
  [[nodiscard]] std::string sealed() const;
  /// Writes it through a temporary file. Throws InputError when it cannot be written.
  void write(const std::filesystem::path& file) const;

 private:
  std::string& line(const std::string& key);
  std::string text_;
  std::size_t depth_ = 0;
  std::vector<std::size_t> steps_;  // levels of each open map or list
  bool item_begins_ = false;
};

/// CRC-32 (IEEE 802.3) as eight hex digits.
std::string checksum(const std::string& text);

/// Refuses a model file whose checksum does not fit its text: it was cut off or edited by hand. (Remove the
/// line `checksum` from a file edited on purpose.) Marks the key as known. Throws InputError. Returns the checksum, 0
/// for a file without.
std::uint32_t check_seal(const config::Yaml& model);

/// Eight hex digits as the number that they are; 0 where they are none.
std::uint32_t checksum_number(const std::string& digits);

/// Exactly `count` numbers below `node`; a fault and zeros otherwise.
std::vector<double> exactly(const config::Node& node, std::size_t count, const char* unit);

}  // namespace invar::compensation
