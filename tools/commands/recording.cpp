// `invar recording info|recover`: what a recording holds and has lost; a whole file out of a cut one.
#include <ctime>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/recording/recording_reader.hpp"
#include "core/recording/recover.hpp"
#include "tools/command.hpp"

namespace invar::tools {

namespace {

using recording::LossLedger;
using recording::Recording;

/// "2026-11-21 22:23:48 UTC" for a time since 1970, "12.5 s" for one of a simulation, which begins at 0.
std::string time_text(Instant time) {
  std::ostringstream text;
  const std::time_t seconds = time.ns / 1'000'000'000;
  std::tm parts{};
  constexpr std::time_t year_2000 = 946'684'800;
  if (seconds >= year_2000 && gmtime_r(&seconds, &parts) != nullptr)
    text << std::put_time(&parts, "%F %T UTC");
  else
    text << time.in_seconds() << " s";
  return text.str();
}

nlohmann::ordered_json recording_json(const Recording& recording, const std::filesystem::path& file) {
  const auto& statistics = recording.statistics();
  const auto ledger = recording.ledger().value_or(LossLedger{});
  nlohmann::ordered_json json{{"file", file.string()},
                              {"bytes", recording.bytes()},
                              {"complete", recording.complete()},
                              {"recovered", ledger.recovered},
                              {"damage", recording.damage()},
                              {"messages", statistics.messages},
                              {"start_ns", statistics.start.ns},
                              {"end_ns", statistics.end.ns},
                              {"channels", nlohmann::ordered_json::array()},
                              {"attachments", nlohmann::ordered_json::array()},
                              {"metadata", nlohmann::ordered_json::object()}};
  for (const auto& [id, channel] : recording.channels()) {
    const auto schema = recording.schemas().find(channel.schema_id);
    const auto count = statistics.by_channel.find(id);
    const auto lost = ledger.channels.find(id);
    nlohmann::ordered_json entry{{"id", id},
                                 {"topic", channel.topic},
                                 {"type", schema == recording.schemas().end() ? "" : schema->second.name},
                                 {"encoding", channel.message_encoding},
                                 {"metadata", channel.metadata},
                                 {"messages", count == statistics.by_channel.end() ? 0 : count->second}};
    if (lost != ledger.channels.end())
      entry["ledger"] = {{"arrived", lost->second.arrived}, {"written", lost->second.written},
                         {"lost", lost->second.lost},       {"gaps", lost->second.gaps},
                         {"missing", lost->second.missing}, {"restarts", lost->second.restarts}};
    json["channels"].push_back(std::move(entry));
  }
  for (const auto& attachment : recording.attachments())
    json["attachments"].push_back({{"name", attachment.name},
                                   {"media_type", attachment.media_type},
                                   {"bytes", attachment.data.size()}});
  for (const auto& metadata : recording.metadata())
    if (metadata.name != LossLedger::name) json["metadata"][metadata.name] = metadata.values;
  return json;
}

void print_recording(const nlohmann::ordered_json& json) {
  const double span =
      static_cast<double>(json["end_ns"].get<std::int64_t>() - json["start_ns"].get<std::int64_t>()) * 1e-9;
  std::cout << json["file"].get<std::string>() << ": " << json["messages"] << " messages in " << span
            << " s from " << time_text({json["start_ns"].get<std::int64_t>()}) << ", " << json["bytes"]
            << " bytes" << (json["complete"] ? "" : ", not closed")
            << (json["recovered"] ? ", recovered from a cut file" : "") << '\n';
  for (const auto& damage : json["damage"]) std::cout << "  " << damage.get<std::string>() << '\n';
  std::size_t widest = 5;
  for (const auto& channel : json["channels"])
    widest = std::max(widest, channel["topic"].get<std::string>().size());
  const auto pad = static_cast<int>(widest) + 2;
  std::cout << '\n'
            << std::left << std::setw(pad) << "topic" << std::right << std::setw(12) << "messages"
            << std::setw(10) << "rate [Hz]" << std::setw(10) << "lost" << std::setw(8) << "gaps"
            << std::setw(10) << "missing"
            << "  type\n";
  for (const auto& channel : json["channels"]) {
    const auto messages = channel["messages"].get<std::uint64_t>();
    std::cout << std::left << std::setw(pad) << channel["topic"].get<std::string>() << std::right
              << std::setw(12) << messages << std::setw(10) << std::setprecision(4);
    if (span > 0.0 && messages > 1)
      std::cout << static_cast<double>(messages - 1) / span;
    else
      std::cout << "-";
    for (const auto& [field, width] : {std::pair{"lost", 10}, {"gaps", 8}, {"missing", 10}}) {
      std::cout << std::setw(width);
      if (channel.contains("ledger"))
        std::cout << channel["ledger"][field].get<std::uint64_t>();
      else
        std::cout << "?";
    }
    std::cout << "  " << channel["type"].get<std::string>() << '\n';
  }
  for (const auto& attachment : json["attachments"])
    std::cout << "attachment  " << attachment["name"].get<std::string>() << " (" << attachment["bytes"]
              << " bytes)\n";
  for (const auto& [name, values] : json["metadata"].items()) std::cout << "metadata    " << name << '\n';
}

struct RecordingCommand {
  std::filesystem::path file, out;
  bool json = false;
};

/// The exit status: 1 where something is damaged.
int info(const RecordingCommand& options) {
  const auto recording = Recording::open(options.file);
  const auto json = recording_json(recording, options.file);
  if (options.json)
    std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  else
    print_recording(json);
  return recording.has_all_data() ? 0 : 1;
}

void recover(const RecordingCommand& options) {
  const auto recording = Recording::open(options.file);
  auto target = options.out;
  if (target.empty())
    target = options.file.parent_path() / (options.file.stem().string() + ".recovered.mcap");
  const auto result = recording::recover(recording, target);
  const auto total = result.ledger.total();
  if (options.json) {
    const nlohmann::ordered_json json{{"file", options.file.string()},
                                      {"recovered", target.string()},
                                      {"damage", recording.damage()},
                                      {"messages", result.messages},
                                      {"channels", result.ledger.channels.size()},
                                      {"missing", total.missing},
                                      {"gaps", total.gaps}};
    std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    return;
  }
  for (const std::string& damage : recording.damage())
    std::cout << options.file.string() << ": " << damage << '\n';
  std::cout << target.string() << ": " << result.messages << " messages of " << result.ledger.channels.size()
            << " channels; by their sequence numbers " << total.missing << " are missing in " << total.gaps
            << " gaps\n";
}

}  // namespace

void add_recording(CLI::App& program) {
  auto* group = program.add_subcommand("recording", "Look into a recording, or recover a cut one");
  group->require_subcommand(1);
  auto options = std::make_shared<RecordingCommand>();

  auto* about = group->add_subcommand("info", "Show channels, counts and the loss ledger");
  about->footer(
      "Example: invar recording info run.mcap\nExit status: 0 all data are there, 1 some cannot be read");
  about->add_option("file", options->file, "the recording (.mcap)")->required();
  about->add_flag("--json", options->json, "print it as JSON");
  about->callback([options] {
    if (const int status = info(*options); status != 0) throw CLI::RuntimeError(status);
  });

  auto* mend =
      group->add_subcommand("recover", "Write a whole file with everything that a cut or damaged one holds");
  mend->footer("Example: invar recording recover run.mcap --out whole.mcap");
  mend->add_option("file", options->file, "the recording (.mcap)")->required();
  mend->add_option("--out", options->out, "file to write (FILE.recovered.mcap)");
  mend->add_flag("--json", options->json, "print what was found as JSON");
  mend->callback([options] { recover(*options); });
}

}  // namespace invar::tools
