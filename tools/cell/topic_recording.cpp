#include "tools/cell/topic_recording.hpp"

#include <typeinfo>

#include "core/base/clock.hpp"
#include "core/dds/wire_type.hpp"
#include "core/recording/type_book.hpp"
#include "idl/standby.h"
#include "tools/cell/each_port.hpp"

namespace invar::tools {

namespace {

recorder::Source source(const std::string& topic, const std::string& type, const std::string& profile) {
  const auto* known = recording::built_in_type(type);
  return {topic, type, profile, known != nullptr ? std::string{known->idl} : ""};
}

}  // namespace

void TopicRecording::read_all(const LoadedCell& loaded, Executor& executor) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      if (!member.component) continue;
      for (const Port* port : member.component->ports()) read(*port);
    }
  each_port(executor, [&](std::size_t, Port& port) { read(port); });
}

void TopicRecording::read(const Port& port) {
  if (port.direction() != Port::Direction::output || !recorder_.is_wanted(port.topic)) return;
  if (port.type() == typeid(standby::WarmState))
    return;  // what two tell each other, and the loop's rate of it
  const auto* type = dds::WireTypes::all().find(port.type());
  // Notices of several components go by one topic: one reader has them all.
  if (type == nullptr || !read_.insert(port.topic).second) return;
  dds::Profile profile = node_.profile(port.profile);
  profile.deadline = {};  // a recorder takes what comes
  const recorder::Source from = source(port.topic, type->name(), port.profile);
  connections_.push_back(
      node_.raw_reader(port.topic, from.type, profile, [this, from](const dds::RawSample& sample) {
        recorder_.record(from, std::string{sample.writer}, sample.sequence, Instant{sample.sent_ns},
                         utc_now(), sample.cdr);
      }));
}

void TopicRecording::take(const dds::LockstepSample& sample) {
  if (!recorder_.is_wanted(sample.topic.topic)) return;
  recorder_.record(source(sample.topic.topic, sample.topic.type, "simulated"), std::string{sample.process},
                   sample.sequence, sample.window, sample.window, sample.cdr);
}

}  // namespace invar::tools
