#include "core/recording/loss_ledger.hpp"

#include <charconv>
#include <nlohmann/json.hpp>

namespace invar::recording {

ChannelLedger LossLedger::total() const {
  ChannelLedger sum;
  for (const auto& [id, channel] : channels) {
    sum.arrived += channel.arrived;
    sum.written += channel.written;
    sum.lost += channel.lost;
    sum.gaps += channel.gaps;
    sum.missing += channel.missing;
    sum.restarts += channel.restarts;
  }
  return sum;
}

mcap::Metadata LossLedger::record() const {
  mcap::Metadata metadata{name, {}};
  for (const auto& [id, channel] : channels) {
    const nlohmann::ordered_json entry{{"topic", channel.topic},      {"arrived", channel.arrived},
                                       {"written", channel.written},  {"lost", channel.lost},
                                       {"gaps", channel.gaps},        {"missing", channel.missing},
                                       {"restarts", channel.restarts}};
    metadata.values[std::to_string(id)] =
        entry.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  }
  metadata.values["recovered"] = recovered ? "true" : "false";
  return metadata;
}

LossLedger LossLedger::from(const mcap::Metadata& record) {
  LossLedger ledger;
  for (const auto& [key, text] : record.values) {
    if (key == "recovered") ledger.recovered = text == "true";
    std::uint16_t id = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), id);
    if (error != std::errc{} || end != key.data() + key.size()) continue;
    const auto entry = nlohmann::json::parse(text, nullptr, false);
    if (!entry.is_object()) continue;
    const auto count = [&](const char* field) -> std::uint64_t {
      const auto found = entry.find(field);
      return found != entry.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
    };
    const auto topic = entry.find("topic");
    ledger.channels[id] = {topic != entry.end() && topic->is_string() ? topic->get<std::string>() : "",
                           count("arrived"),
                           count("written"),
                           count("lost"),
                           count("gaps"),
                           count("missing"),
                           count("restarts")};
  }
  return ledger;
}

}  // namespace invar::recording
