#include "core/recording/recover.hpp"

#include <map>

#include "core/base/fault.hpp"

namespace invar::recording {

Recovery recover(const Recording& recording, const std::filesystem::path& target,
                 const ChunkOptions& options) {
  std::filesystem::path temporary = target;
  temporary += ".part";
  McapFileWriter file{temporary, options};
  Recovery result;
  result.ledger.recovered = true;
  for (const auto& [id, schema] : recording.schemas()) file.write(schema);
  for (const auto& [id, channel] : recording.channels()) {
    file.write(channel);
    result.ledger.channels[id].topic = channel.topic;
  }
  for (const auto& attachment : recording.attachments()) file.write(attachment);
  for (const auto& metadata : recording.metadata())
    if (metadata.name != LossLedger::name) file.write(metadata);
  std::map<std::uint16_t, SequenceFollower> followers;
  auto stream = recording.messages();
  while (const auto message = stream.next()) {
    const std::uint16_t id = message->channel->id;
    file.write(mcap::Message{id, message->sequence, message->log_time, message->publish_time, message->data});
    auto& ledger = result.ledger.channels[id];
    ++ledger.written;
    followers[id].observe(message->sequence, ledger);
  }
  const auto before = recording.ledger().value_or(LossLedger{});
  for (auto& [id, ledger] : result.ledger.channels) {
    if (const auto found = before.channels.find(id); found != before.channels.end())
      ledger.lost = found->second.lost;
    ledger.arrived = ledger.written + ledger.lost;
  }
  file.write(result.ledger.record());
  if (!file.close()) {
    std::filesystem::remove(temporary);
    throw InputError{target.string(), "cannot be written",
                     "check the folder, its permissions and the space left"};
  }
  std::filesystem::rename(temporary, target);
  result.messages = result.ledger.total().written;
  result.damaged_chunks = stream.damaged_chunks();
  return result;
}

}  // namespace invar::recording
