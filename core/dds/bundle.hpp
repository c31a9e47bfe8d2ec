// Bundle: the samples that a process wrote in one window of simulated time, in the order written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace invar::dds {

/// A topic that a process writes; its number in bundles is its position in the process's list.
struct BundleTopic {
  std::string topic;
  std::string type;
};

/// Records of topic number, length and CDR bytes.
class Bundle {
 public:
  void add(std::uint32_t topic, std::span<const std::byte> cdr) {
    append(topic);
    append(static_cast<std::uint32_t>(cdr.size()));
    const auto* begin = reinterpret_cast<const std::uint8_t*>(cdr.data());
    bytes_.insert(bytes_.end(), begin, begin + cdr.size());
  }
  void clear() { bytes_.clear(); }
  [[nodiscard]] const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  void append(std::uint32_t number) {
    const auto at = bytes_.size();
    bytes_.resize(at + sizeof number);
    std::memcpy(bytes_.data() + at, &number, sizeof number);
  }
  std::vector<std::uint8_t> bytes_;
};

using BundleVisitor = std::function<void(std::uint32_t topic, std::span<const std::byte> cdr)>;

/// Calls `visit` for every record; false when the bytes are not a bundle.
inline bool read_bundle(std::span<const std::uint8_t> bytes, const BundleVisitor& visit) {
  while (!bytes.empty()) {
    std::uint32_t header[2];
    if (bytes.size() < sizeof header) return false;
    std::memcpy(header, bytes.data(), sizeof header);
    bytes = bytes.subspan(sizeof header);
    if (bytes.size() < header[1]) return false;
    visit(header[0], std::as_bytes(bytes.first(header[1])));
    bytes = bytes.subspan(header[1]);
  }
  return true;
}

/// Announcement of a process that joins: the topics that it writes, and those that it wants.
struct Membership {
  std::string process;
  std::vector<BundleTopic> written;
  std::vector<std::string> wanted;  // "*": all
};
[[nodiscard]] std::vector<std::uint8_t> write_membership(const Membership& membership);
[[nodiscard]] Membership read_membership(const std::vector<std::uint8_t>& bytes);

}  // namespace invar::dds
