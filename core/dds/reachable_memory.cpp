#include "core/dds/reachable_memory.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <memory>
#include <string_view>

#include "core/dds/one_sender.hpp"
#include "core/dds/port_memory.hpp"

namespace invar::dds {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

/// Begins the user data of our participants; a MemoryIdentity follows.
constexpr std::string_view mark = "invar pid ";

/// FNV-1a.
std::uint64_t hash(std::string_view text) {
  std::uint64_t value = 14695981039346656037ULL;
  for (const char c : text) value = (value ^ static_cast<std::uint8_t>(c)) * 1099511628211ULL;
  return value == 0 ? 1 : value;
}

std::uint64_t boot_identity() {
  std::ifstream file{"/proc/sys/kernel/random/boot_id"};
  std::string text;
  return std::getline(file, text) ? hash(text) : 0;
}

/// Each tmpfs has a device number of its own, whatever container or mount namespace shows it; a user id means one user only
/// within one user namespace.
std::uint64_t folder_identity() {
  struct stat folder {
  }, users{};
  if (stat("/dev/shm", &folder) != 0) return 0;
  const ino_t space = stat("/proc/self/ns/user", &users) == 0 ? users.st_ino : 0;
  return hash(std::to_string(folder.st_dev) + '/' + std::to_string(folder.st_ino) + '/' +
              std::to_string(space));
}

/// Where a locator of shared memory keeps what. Fast DDS writes the first three octets: 'U' or 'M', and a number of the PC.
constexpr std::size_t host_at = 1, folder_at = 4, user_at = 12;

template <class T>
T get(const rtps::Locator_t& locator, std::size_t at) {
  T value{};
  std::memcpy(&value, locator.address + at, sizeof value);
  return value;
}

template <class T>
void put(rtps::Locator_t& locator, std::size_t at, T value) {
  std::memcpy(locator.address + at, &value, sizeof value);
}

/// The number of a PC as others must not know it: with every bit turned.
void turn_host(rtps::Locator_t& locator) {
  put(locator, host_at, static_cast<std::uint16_t>(~get<std::uint16_t>(locator, host_at)));
}

struct ChainDescriptor final : transport::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;
  [[nodiscard]] transport::TransportInterface* create_transport() const override;
};

class Transport final : public transport::ChainingTransport {
 public:
  explicit Transport(const ChainDescriptor& descriptor)
      : ChainingTransport{descriptor}, descriptor_{descriptor} {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool getDefaultMetatrafficMulticastLocators(rtps::LocatorList_t& locators,
                                              std::uint32_t port) const override {
    rtps::LocatorList_t ours;
    const bool made = low_level_transport_->getDefaultMetatrafficMulticastLocators(ours, port);
    return append(locators, ours, made);
  }
  bool getDefaultMetatrafficUnicastLocators(rtps::LocatorList_t& locators,
                                            std::uint32_t port) const override {
    rtps::LocatorList_t ours;
    const bool made = low_level_transport_->getDefaultMetatrafficUnicastLocators(ours, port);
    return append(locators, ours, made);
  }
  bool getDefaultUnicastLocators(rtps::LocatorList_t& locators, std::uint32_t port) const override {
    rtps::LocatorList_t ours;
    const bool made = low_level_transport_->getDefaultUnicastLocators(ours, port);
    return append(locators, ours, made);
  }

  bool transform_remote_locator(const rtps::Locator_t& remote, rtps::Locator_t& result) const override {
    if (remote.kind != LOCATOR_KIND_SHM || get<std::uint64_t>(remote, folder_at) != own_.folder ||
        get<std::uint32_t>(remote, user_at) != own_.user)
      return false;
    if (!low_level_transport_->transform_remote_locator(remote, result)) return false;
    turn_host(result);
    give_up_replaced_port(remote.port);
    return true;
  }

  bool OpenOutputChannel(eprosima::fastdds::rtps::SendResourceList& senders,
                         const rtps::Locator_t& locator) override {
    return open_one_sender(senders, kind(),
                           [&] { return ChainingTransport::OpenOutputChannel(senders, locator); });
  }

  bool send(rtps::SenderResource* sender, const rtps::octet* bytes, std::uint32_t size,
            rtps::LocatorsIterator* begin, rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& until) override {
    return sender->send(bytes, size, begin, end, until);
  }
  void receive(transport::TransportReceiverInterface* next, const rtps::octet* bytes, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    next->OnDataReceived(bytes, size, local, remote);
  }

 private:
  bool append(rtps::LocatorList_t& locators, const rtps::LocatorList_t& ours, bool made) const {
    for (rtps::Locator_t locator : ours) {
      turn_host(locator);
      put(locator, folder_at, own_.folder);
      put(locator, user_at, own_.user);
      locators.push_back(locator);
    }
    return made;
  }

  ChainDescriptor descriptor_;
  const MemoryIdentity own_ = own_memory_identity();
};

transport::TransportInterface* ChainDescriptor::create_transport() const { return new Transport{*this}; }

}  // namespace

transport::TransportInterface* ReachableMemory::create_transport() const {
  // A copy of the base alone: its create_transport makes the transport of Fast DDS.
  const ChainDescriptor chain{std::make_shared<transport::SharedMemTransportDescriptor>(*this)};
  return chain.create_transport();
}

rtps::LocatorList_t ReachableMemory::discovery_group(std::uint32_t port) const {
  rtps::LocatorList_t group;
  const std::unique_ptr<transport::TransportInterface> one{create_transport()};
  (void)one->getDefaultMetatrafficMulticastLocators(group, port);
  return group;
}

MemoryIdentity own_memory_identity() { return {getpid(), geteuid(), boot_identity(), folder_identity()}; }

std::vector<std::uint8_t> to_user_data(const MemoryIdentity& identity, std::uint8_t calls) {
  std::vector<std::uint8_t> data{mark.begin(), mark.end()};
  const auto add = [&data](const auto& value) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
    data.insert(data.end(), bytes, bytes + sizeof value);
  };
  add(identity.process);
  add(identity.user);
  add(identity.boot);
  add(identity.folder);
  add(calls);
  return data;
}

std::optional<MemoryIdentity> memory_identity_from(const std::vector<std::uint8_t>& data) {
  MemoryIdentity out;
  const std::size_t size =
      mark.size() + sizeof out.process + sizeof out.user + sizeof out.boot + sizeof out.folder + 1;
  if (data.size() != size || !std::equal(mark.begin(), mark.end(), data.begin())) return std::nullopt;
  const std::uint8_t* next = data.data() + mark.size();
  const auto take = [&next](auto& value) {
    std::memcpy(&value, next, sizeof value);
    next += sizeof value;
  };
  take(out.process);
  take(out.user);
  take(out.boot);
  take(out.folder);
  return out;
}

bool is_reachable(const MemoryIdentity& one, const MemoryIdentity& other) {
  return one.boot == other.boot && one.folder != 0 && one.folder == other.folder && one.user == other.user;
}

std::string why_unreachable(const MemoryIdentity& own, const MemoryIdentity& peer) {
  if (own.boot != peer.boot || own.folder == 0 || peer.folder == 0 || is_reachable(own, peer)) return "";
  if (own.folder != peer.folder)
    return "it has another /dev/shm than this process (a container?); give both one: in a container "
           "--ipc=host "
           "or -v /dev/shm:/dev/shm, and the same user";
  return "it runs as user " + std::to_string(peer.user) + ", this process as user " +
         std::to_string(own.user) + "; run both as one user";
}

}  // namespace invar::dds
