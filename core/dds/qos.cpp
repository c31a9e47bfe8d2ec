#include "core/dds/qos.hpp"

namespace invar::dds {

namespace fdds = eprosima::fastdds::dds;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::ResourceLimitedContainerConfig;

namespace {

Duration_t wire_time(Duration time) {
  if (time.ns == 0) return eprosima::fastrtps::c_TimeInfinite;
  return {static_cast<std::int32_t>(time.ns / 1'000'000'000),
          static_cast<std::uint32_t>(time.ns % 1'000'000'000)};
}

Duration from_wire(const Duration_t& time) {
  if (time == eprosima::fastrtps::c_TimeInfinite) return {};
  return {time.to_ns()};
}

/// The policies that writer and reader QoS have in common.
template <class Qos>
void set_common(Qos& qos, const Profile& p) {
  qos.reliability().kind = p.reliable ? fdds::RELIABLE_RELIABILITY_QOS : fdds::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().kind = p.keep_all ? fdds::KEEP_ALL_HISTORY_QOS : fdds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = static_cast<std::int32_t>(p.depth);
  qos.durability().kind = p.durability == Durability::transient_local ? fdds::TRANSIENT_LOCAL_DURABILITY_QOS
                                                                      : fdds::VOLATILE_DURABILITY_QOS;
  qos.deadline().period = wire_time(p.deadline);
  qos.lifespan().duration = wire_time(p.lifespan);
  qos.liveliness().kind = p.liveliness == Liveliness::automatic ? fdds::AUTOMATIC_LIVELINESS_QOS
                          : p.liveliness == Liveliness::manual_by_topic
                              ? fdds::MANUAL_BY_TOPIC_LIVELINESS_QOS
                              : fdds::MANUAL_BY_PARTICIPANT_LIVELINESS_QOS;
  qos.liveliness().lease_duration = wire_time(p.lease);
  qos.ownership().kind = p.exclusive ? fdds::EXCLUSIVE_OWNERSHIP_QOS : fdds::SHARED_OWNERSHIP_QOS;
  auto& limits = qos.resource_limits();
  limits.max_instances = static_cast<std::int32_t>(p.max_instances);
  limits.max_samples_per_instance = static_cast<std::int32_t>(p.depth);
  limits.max_samples = static_cast<std::int32_t>(p.depth * p.max_instances);
  limits.allocated_samples = p.traffic == Traffic::realtime && !p.keep_all ? limits.max_samples : 0;
  limits.extra_samples = 4;
  const ResourceLimitedContainerConfig peers{32, std::numeric_limits<std::size_t>::max(), 8};
  if constexpr (requires { qos.writer_resource_limits(); })
    qos.writer_resource_limits().matched_subscriber_allocation = peers;
  else
    qos.reader_resource_limits().matched_publisher_allocation = peers;
  // Loans and data sharing exclude keyed topics; off keeps a log message away.
  qos.data_sharing().off();
  // The loop's samples have one size; others would reserve their bound, megabytes for some.
  qos.endpoint().history_memory_policy = p.traffic == Traffic::realtime
                                             ? eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE
                                             : eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
}

template <class Qos>
Profile described_common(const Qos& qos) {
  Profile p;
  p.reliable = qos.m_reliability.kind == fdds::RELIABLE_RELIABILITY_QOS;
  p.durability = static_cast<Durability>(qos.m_durability.kind);
  p.deadline = from_wire(qos.m_deadline.period);
  p.lifespan = from_wire(qos.m_lifespan.duration);
  p.liveliness = static_cast<Liveliness>(qos.m_liveliness.kind);
  p.lease = from_wire(qos.m_liveliness.lease_duration);
  p.exclusive = qos.m_ownership.kind == fdds::EXCLUSIVE_OWNERSHIP_QOS;
  p.partitions = qos.m_partition.getNames();
  return p;
}

}  // namespace

fdds::DataWriterQos writer_qos(const Profile& p) {
  fdds::DataWriterQos qos;
  set_common(qos, p);
  if (p.lease.ns != 0) qos.liveliness().announcement_period = wire_time(p.lease / 3);
  qos.ownership_strength().value = static_cast<std::uint32_t>(p.strength);
  // Fast DDS spins while its shared memory is full; a sample of the loop is soon overtaken, and dropped instead.
  constexpr Duration loop_patience = Duration::microseconds(100);
  const bool is_of_loop = p.traffic == Traffic::realtime && !p.reliable;
  qos.reliability().max_blocking_time =
      wire_time(is_of_loop ? std::min(p.blocking, loop_patience) : p.blocking);
  // While a sample is not acknowledged: at 5 % loss a command at 100 Hz comes within 9 ms at p99, at 20 ms within 30 ms.
  qos.reliable_writer_qos().times.heartbeatPeriod = {0, 5'000'000};
  qos.reliable_writer_qos().times.nackResponseDelay = {0, 1'000'000};
  qos.reliable_writer_qos().disable_heartbeat_piggyback = !p.asks_at_once;
  qos.publish_mode().kind = fdds::SYNCHRONOUS_PUBLISH_MODE;
  if (p.flow > 0) {
    qos.publish_mode().kind = fdds::ASYNCHRONOUS_PUBLISH_MODE;
    qos.publish_mode().flow_controller_name = p.name.c_str();
  }
  // Instances are disposed by decision, not because a writer went away.
  qos.writer_data_lifecycle().autodispose_unregistered_instances = false;
  return qos;
}

fdds::DataReaderQos reader_qos(const Profile& p) {
  fdds::DataReaderQos qos;
  set_common(qos, p);
  qos.reliable_reader_qos().times.heartbeatResponseDelay = {0, 1'000'000};
  // Fast DDS would drop in silence what the clock of another PC makes old: CommandGate refuses it, and says so.
  qos.lifespan().duration = eprosima::fastrtps::c_TimeInfinite;
  return qos;
}

Profile described(const fdds::WriterQos& qos) {
  Profile p = described_common(qos);
  p.strength = qos.m_ownershipStrength.value;
  for (const auto kind : qos.representation.m_value)
    p.representations.push_back(static_cast<std::int16_t>(kind));
  return p;
}

Profile described(const fdds::ReaderQos& qos) {
  Profile p = described_common(qos);
  for (const auto kind : qos.representation.m_value)
    p.representations.push_back(static_cast<std::int16_t>(kind));
  return p;
}

}  // namespace invar::dds
