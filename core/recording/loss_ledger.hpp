// The loss ledger: what reached the recorder, what of it is in the file, and what never arrived, channel by
// channel.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/recording/mcap_records.hpp"

namespace invar::recording {

struct ChannelLedger {
  std::string topic;
  std::uint64_t arrived = 0;   // given to the writer
  std::uint64_t written = 0;   // in the file
  std::uint64_t lost = 0;      // arrived, but the queue was full or the disk failed
  std::uint64_t gaps = 0;      // places where the sequence number jumped forward
  std::uint64_t missing = 0;   // samples that those jumps skipped: lost before they arrived
  std::uint64_t restarts = 0;  // places where it stepped back: its source began anew
};

/// Follows the sequence numbers of one channel. 0 says that the source has none.
class SequenceFollower {
 public:
  void observe(std::uint32_t sequence, ChannelLedger& ledger) {
    if (sequence == 0 && last_ != ~std::uint32_t{0}) return;
    const std::uint32_t step = sequence - last_;  // wraps as the number does
    if (seen_ && step > 1U && step < (1U << 31U)) {
      ++ledger.gaps;
      ledger.missing += step - 1U;
    } else if (seen_ && (step == 0 || step >= (1U << 31U))) {
      ++ledger.restarts;
    }
    last_ = sequence;
    seen_ = true;
  }

 private:
  std::uint32_t last_ = 0;
  bool seen_ = false;
};

/// By channel id. Where nothing was lost, `arrived == written`; always `arrived == written + lost` once
/// closed.
struct LossLedger {
  static constexpr const char* name = "invar.loss_ledger";

  std::map<std::uint16_t, ChannelLedger> channels;
  bool recovered = false;  // made anew from a cut file: `lost` is not known any more, gaps and missing are

  [[nodiscard]] ChannelLedger total() const;
  /// As a metadata record: channel id -> JSON object of the fields above.
  [[nodiscard]] mcap::Metadata record() const;
  /// Values that are no ledger entries are passed over.
  static LossLedger from(const mcap::Metadata& record);
};

}  // namespace invar::recording
