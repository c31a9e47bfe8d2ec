#include "core/dds/receive_filter.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/rtps/common/LocatorsIterator.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <mutex>
#include <span>
#include <thread>

#include "core/dds/domain_ports.hpp"
#include "core/dds/one_sender.hpp"
#include "core/dds/rtps_submessage.hpp"

namespace invar::dds {

namespace {

namespace rtps = eprosima::fastrtps::rtps;
namespace transport = eprosima::fastdds::rtps;

constexpr std::size_t largest_datagram = 65'536;

/// A copy of a message that the library may read beyond its end, and in which parameters can be taken out. Made once a thread.
std::byte* scratch() {
  thread_local const auto bytes = std::make_unique<std::array<std::byte, 2 * largest_datagram>>();
  return bytes->data();
}

/// The id of a parameter that readers skip, in both byte orders.
void hide(std::byte* message, const RtpsContent& content) {
  for (std::size_t i = 0; i < content.hidden_count; ++i)
    std::memset(message + content.hidden[i], 0, sizeof(std::uint16_t));
}

/// Our own fragments, as they go out.
void note_fragments(std::span<const std::byte> message, SequenceGuard& guard) {
  constexpr std::uint8_t data_frag = 0x16;
  std::size_t position = rtps_header_size;
  while (const auto sub = submessage_at(message, position)) {
    position = sub->end;
    if (sub->id != data_frag) continue;
    RtpsBytes bytes = sub->bytes();
    bytes.skip(8);  // flags, length to inline QoS, reader
    const std::uint32_t writer = bytes.entity();
    const std::int64_t number = bytes.sequence_number();
    bytes.skip(6);  // first fragment, count
    const std::uint32_t size = bytes.u16();
    const std::uint32_t sample = bytes.u32();
    if (bytes.ok() && size > 0) guard.sent(writer, number, (sample + size - 1) / size);
  }
}

bool is_loopback(const rtps::Locator_t& locator) {
  return locator.kind == LOCATOR_KIND_UDPv4 && rtps::IPLocator::getIPv4(locator)[0] == 127;
}

/// Those of a row of locators that a sender reaches: the loopback's, or the others'; groups are reached by both.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"  // of Fast DDS; this one lives on the stack
class Reached final : public rtps::LocatorsIterator {
 public:
  Reached(rtps::LocatorsIterator& all, rtps::LocatorsIterator& end, bool loopback)
      : all_{all}, end_{end}, loopback_{loopback} {
    pass();
  }
  rtps::LocatorsIterator& operator++() override {
    ++all_;
    pass();
    return *this;
  }
  bool operator==(const rtps::LocatorsIterator&) const override { return all_ == end_; }
  bool operator!=(const rtps::LocatorsIterator&) const override { return all_ != end_; }
  const rtps::Locator_t& operator*() const override { return *all_; }

 private:
  void pass() {
    while (all_ != end_ && !rtps::IPLocator::isMulticast(*all_) && is_loopback(*all_) != loopback_) ++all_;
  }

  rtps::LocatorsIterator& all_;
  rtps::LocatorsIterator& end_;
  bool loopback_;
};
#pragma GCC diagnostic pop

/// Which senders leave by the loopback; each is asked once, when it sends first. Any thread.
class Senders {
 public:
  bool is_loopback(rtps::SenderResource& sender) {
    for (const Known& known : known_) {
      const auto* its = known.sender.load(std::memory_order_acquire);
      if (its == &sender) return known.loopback;
      if (its == nullptr) break;
    }
    return ask(sender);
  }

 private:
  struct Known {
    std::atomic<const rtps::SenderResource*> sender{nullptr};
    bool loopback = false;
  };

  bool ask(rtps::SenderResource& sender) {
    rtps::LocatorList_t own;
    sender.add_locators_to_list(own);
    const bool loopback = own.size() > 0 && invar::dds::is_loopback(*own.begin());
    const std::lock_guard lock{mutex_};
    for (Known& known : known_)
      if (known.sender.load(std::memory_order_relaxed) == nullptr) {
        known.loopback = loopback;
        known.sender.store(&sender, std::memory_order_release);
        break;
      }
    return loopback;
  }

  std::mutex mutex_;
  std::array<Known, 8> known_;  // one an address of the PC that carries the cell's traffic
};

class Filter final : public transport::ChainingTransport {
 public:
  Filter(const transport::ChainingTransportDescriptor& chain, std::shared_ptr<Reception> reception,
         bool parts_loopback)
      : ChainingTransport{chain},
        below_{chain.low_level_descriptor},
        reception_{std::move(reception)},
        parts_loopback_{parts_loopback} {}

  transport::TransportDescriptorInterface* get_configuration() override { return below_.get(); }

  bool OpenOutputChannel(eprosima::fastdds::rtps::SendResourceList& senders,
                         const rtps::Locator_t& locator) override {
    return open_one_sender(senders, kind(),
                           [&] { return ChainingTransport::OpenOutputChannel(senders, locator); });
  }

  bool send(rtps::SenderResource* below, const rtps::octet* data, std::uint32_t size,
            rtps::LocatorsIterator* begin, rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    note_fragments(std::as_bytes(std::span{data, size}), reception_->guard());
    if (!parts_loopback_) return below->send(data, size, begin, end, timeout);
    Reached reached{*begin, *end, senders_.is_loopback(*below)};
    return below->send(data, size, &reached, end, timeout);
  }

  void receive(transport::TransportReceiverInterface* next, const rtps::octet* data, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    // Nothing: memory that cannot be opened (shared_memory_calls.cpp), of another user or one that has ended. Lost, no flaw.
    if (size == 0 && local.kind == LOCATOR_KIND_SHM) return;
    reception_->wait_until_open();
    const auto message = std::as_bytes(std::span{data, size});
    RtpsContent content;
    const Flaw flaw = examine(message, reception_->limits(), reception_->guard(), content);
    if (flaw != Flaw::none) return reception_->drop(flaw, remote);
    if (reception_->is_revoked(content.source)) return reception_->drop_of_revoked();
    const bool copied = (content.has_fragments || content.hidden_count > 0) && size <= largest_datagram;
    if (copied) {
      std::memcpy(scratch(), data, content.size);
      hide(scratch(), content);
      data = reinterpret_cast<const rtps::octet*>(scratch());
    } else if (content.hidden_count > 0) {
      return reception_->drop(Flaw::discovery, remote);
    }
    std::unique_lock alone{reception_->acquaintance(), std::defer_lock};
    if (reception_->limits().secured && DomainPorts::is_of_discovery(local.port)) alone.lock();
    next->OnDataReceived(data, static_cast<std::uint32_t>(content.size), local, remote);
  }

 private:
  std::shared_ptr<transport::TransportDescriptorInterface> below_;
  std::shared_ptr<Reception> reception_;
  bool parts_loopback_;
  Senders senders_;
};

/// What the constructor of a chaining transport asks for.
struct Chain final : transport::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;
  [[nodiscard]] transport::TransportInterface* create_transport() const override { return nullptr; }
};

/// Address and port as one number; 0: of no UDP sender.
std::uint64_t sender_of(const rtps::Locator_t& locator) {
  if (locator.kind != LOCATOR_KIND_UDPv4) return 0;
  std::uint64_t sender = 0;
  for (const rtps::octet octet : std::span{locator.address}.last<4>()) sender = sender << 8U | octet;
  return sender << 16U | rtps::IPLocator::getPhysicalPort(locator);
}

std::string sender_text(std::uint64_t sender) {
  if (sender == 0) return "shared memory of this PC";
  std::string text;
  for (unsigned shift = 48; shift > 16; shift -= 8)
    text += (text.empty() ? "" : ".") + std::to_string(sender >> (shift - 8U) & 0xffU);
  return text + ":" + std::to_string(sender & 0xffffU);
}

}  // namespace

transport::TransportInterface* make_filter(std::shared_ptr<transport::TransportDescriptorInterface> below,
                                           std::shared_ptr<Reception> reception, bool parts_loopback) {
  return new Filter{Chain{std::move(below)}, std::move(reception), parts_loopback};
}

void Reception::know_participant(const GuidPrefix& prefix) {
  for (const std::uint32_t writer :
       {participant_writer, participant_message_writer, publication_writer, subscription_writer})
    guard_.know(prefix, writer);
}

void Reception::revoke(std::vector<HolderId> holders) {
  const std::lock_guard lock{revoked_mutex_};
  lists_.push_back(std::make_unique<const Holders>(std::move(holders)));
  revoked_.store(lists_.back().get(), std::memory_order_release);
}

bool Reception::is_revoked(const GuidPrefix& source) const noexcept {
  const Holders* revoked = revoked_.load(std::memory_order_acquire);
  return revoked != nullptr && std::binary_search(revoked->begin(), revoked->end(), holder_of(source));
}

void Reception::wait_until_open() {
  constexpr auto pause = std::chrono::microseconds{100};
  for (int i = 0; i < 10'000 && !open_.load(std::memory_order_acquire); ++i)
    std::this_thread::sleep_for(pause);
}

void Reception::drop(Flaw flaw, const rtps::Locator_t& sender) {
  dropped_[static_cast<std::size_t>(flaw)].fetch_add(1, std::memory_order_relaxed);
  sender_.store(sender_of(sender), std::memory_order_relaxed);
}

std::uint64_t Reception::dropped(Flaw flaw) const {
  return dropped_[static_cast<std::size_t>(flaw)].load(std::memory_order_relaxed);
}

std::uint64_t Reception::dropped() const {
  std::uint64_t sum = 0;
  for (const auto& count : dropped_) sum += count.load(std::memory_order_relaxed);
  return sum;
}

std::optional<std::string> Reception::report(Instant now) {
  constexpr Duration pause = Duration::seconds(10);  // a person reads no faster
  if (now - told_at_ < pause) return std::nullopt;
  std::string causes;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < flaws; ++i) {
    const std::uint64_t count = dropped_[i].load(std::memory_order_relaxed);
    if (count != told_[i])
      causes += (causes.empty() ? "" : ", ") + std::to_string(count - told_[i]) + " with " +
                std::string{flaw_text(static_cast<Flaw>(i))};
    told_[i] = count;
    sum += count;
  }
  if (causes.empty()) return std::nullopt;
  told_at_ = now;
  return "dropped messages that no DDS program should send: " + causes + "; the last one from " +
         sender_text(sender_.load(std::memory_order_relaxed)) + "; " + std::to_string(sum) +
         " since the start; find out what sends there";
}

}  // namespace invar::dds
