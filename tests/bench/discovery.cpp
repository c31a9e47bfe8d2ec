// Bench: how long participants that start at the same moment take until each reader is matched with each writer.
//   bench_discovery invar|plain ADDRESS FIRST COUNT TOTAL AT_NS
// COUNT processes with one participant, one writer and one reader each begin at AT_NS of the monotonic clock; a reader is done when it
// knows TOTAL writers. `plain` is Fast DDS with its defaults, on UDP as well. A line each: the time it took [s], or `missing N`.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <sys/wait.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <array>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/base/clock.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/node.hpp"
#include "idl/lifecyclePubSubTypes.h"

namespace {

using namespace invar;
namespace fdds = eprosima::fastdds::dds;

constexpr std::uint32_t domain = 89;
constexpr double longest = 60.0;  // s

std::string topic() { return invar::dds::ServiceTopics{"bench"}.process_status; }

/// How many writers the reader of this process knows.
using Known = std::function<std::size_t()>;

Known as_invar(const std::string& address, int number) {
  invar::dds::NodeOptions options;
  options.cell = "bench";
  options.process = "p" + std::to_string(number);
  options.domain = domain;
  options.addresses = {address};
  options.shared_memory = false;
  static invar::dds::Node node{options, invar::dds::standard_profiles()};
  static const auto reader = node.reader<lifecycle::ProcessStatus>(topic(), "state", [](const auto&) {});
  static const auto writer = node.writer<lifecycle::ProcessStatus>(topic(), "state");
  return [] { return reader->matched(); };
}

Known as_fast_dds(const std::string& address) {
  fdds::DomainParticipantQos qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {address};
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto* participant = fdds::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
  fdds::TypeSupport type{new lifecycle::ProcessStatusPubSubType};
  type.register_type(participant);
  auto* on = participant->create_topic(topic(), type.get_type_name(), fdds::TOPIC_QOS_DEFAULT);
  fdds::DataReaderQos reading;
  reading.reliability().kind = fdds::RELIABLE_RELIABILITY_QOS;
  auto* reader = participant->create_subscriber(fdds::SUBSCRIBER_QOS_DEFAULT)->create_datareader(on, reading);
  (void)participant->create_publisher(fdds::PUBLISHER_QOS_DEFAULT)
      ->create_datawriter(on, fdds::DATAWRITER_QOS_DEFAULT);
  return [reader] {
    fdds::SubscriptionMatchedStatus status;
    reader->get_subscription_matched_status(status);
    return static_cast<std::size_t>(status.current_count);
  };
}

std::string find(const Known& known, std::size_t total, Instant begin) {
  while (known() < total) {
    if ((monotonic_now() - begin).in_seconds() > longest) return "missing " + std::to_string(total - known());
    std::this_thread::sleep_for(std::chrono::milliseconds{20});  // to look costs the CPU that others need
  }
  return std::to_string((monotonic_now() - begin).in_seconds());
}

}  // namespace

int main(int count, char** words) {
  if (count != 7) return 2;
  const bool plain = std::string_view{words[1]} == "plain";
  const int first = std::atoi(words[3]), processes = std::atoi(words[4]);
  const auto total = static_cast<std::size_t>(std::atoi(words[5]));
  const Instant begin{std::atoll(words[6])};
  std::array<int, 2> done{};
  if (pipe(done.data()) != 0) return 2;
  for (int i = 0; i < processes; ++i) {
    if (fork() != 0) continue;
    std::this_thread::sleep_for(std::chrono::nanoseconds{(begin - monotonic_now()).ns});
    const Known known = plain ? as_fast_dds(words[2]) : as_invar(words[2], first + i);
    std::cout << find(known, total, begin) + "\n" << std::flush;
    char end = 0;
    close(done[1]);
    (void)!read(done[0], &end, 1);  // nobody leaves before all are found
    _exit(0);
  }
  close(done[0]);
  std::string line;
  std::getline(std::cin, line);  // the caller has all lines
  close(done[1]);
  while (wait(nullptr) > 0) {
  }
  return 0;
}
