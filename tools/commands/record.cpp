// `invar record`: the topics of a running cell into an MCAP file, with a ledger of what was lost.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/clock.hpp"
#include "core/base/name.hpp"
#include "core/dds/clock_offset.hpp"
#include "core/recording/recording_writer.hpp"
#include "core/recording/type_book.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"
#include "tools/live/topic_watch.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct RecordOptions {
  explicit RecordOptions(CLI::App& command) : call{command, {}} {}
  CellCall call;
  std::filesystem::path out;
  std::vector<std::string> topics;
  double duration = 0.0;
  std::uint64_t reserve_mb = 64;
  bool all = false;
  bool json = false;
};

/// The name of the profile that a writer's QoS is most like, for replaying it.
std::string profile_like(const dds::Profiles& profiles, const dds::Profile& qos) {
  for (const auto& [name, profile] : profiles)
    if (profile.reliable == qos.reliable && profile.durability == qos.durability &&
        profile.exclusive == qos.exclusive && profile.deadline == qos.deadline &&
        profile.lifespan == qos.lifespan)
      return name;
  return "";
}

/// A channel for each writer of each topic.
class Channels {
 public:
  Channels(recording::RecordingWriter& file, const dds::Profiles& profiles)
      : file_{file}, profiles_{profiles} {}

  void write(const dds::Endpoint& end, const dds::RawSample& sample) {
    const std::lock_guard lock{mutex_};
    auto [channel, is_new] = channels_.try_emplace({end.topic, std::string{sample.writer}}, std::uint16_t{0});
    if (is_new) {
      const auto* known = recording::built_in_type(end.type);
      std::string partitions;
      for (const auto& name : end.qos.partitions) partitions += (partitions.empty() ? "" : ",") + name;
      channel->second = file_.add_channel({.topic = end.topic,
                                           .type = end.type,
                                           .idl = known != nullptr ? std::string{known->idl} : "",
                                           .qos = profile_like(profiles_, end.qos),
                                           .partitions = partitions,
                                           .more = {{"writer", std::string{sample.writer}}}});
    }
    file_.write(channel->second, static_cast<std::uint32_t>(sample.sequence), utc_now(),
                Instant{sample.sent_ns},
                {reinterpret_cast<const std::uint8_t*>(sample.cdr.data()), sample.cdr.size()});
  }

 private:
  recording::RecordingWriter& file_;
  const dds::Profiles& profiles_;
  std::mutex mutex_;
  std::map<std::pair<std::string, std::string>, std::uint16_t> channels_;
};

void report(const recording::LossLedger& ledger, const RecordOptions& options) {
  const auto total = ledger.total();
  if (options.json) {
    nlohmann::ordered_json json{{"file", options.out.string()},
                                {"written", total.written},
                                {"lost", total.lost},
                                {"missing", total.missing},
                                {"channels", nlohmann::json::array()}};
    for (const auto& [id, channel] : ledger.channels)
      json["channels"].push_back({{"topic", channel.topic},
                                  {"written", channel.written},
                                  {"lost", channel.lost},
                                  {"missing", channel.missing}});
    std::cout << json.dump(2) << '\n';
    return;
  }
  TextTable table{{"topic", "written>", "lost>", "missing>"}};
  for (const auto& [id, channel] : ledger.channels)
    table.add({channel.topic, std::to_string(channel.written), std::to_string(channel.lost),
               std::to_string(channel.missing)});
  table.print(std::cout);
  std::cout << options.out.string() << ": " << total.written << " samples; " << total.lost << " lost here, "
            << total.missing << " missing before they arrived\n";
}

/// Tools take no part in comparing clocks; the recorder of the cell does.
void tell_clocks(LiveCell& cell) {
  constexpr std::int64_t worth_a_word = 10'000'000;  // ns: less than a worker's period
  std::set<std::string> told;
  for (const auto& process : cell.client().processes()) {
    const std::int64_t ahead = process.clock_ahead_ns() - process.stamps_behind_ns();
    const std::string host = process.host().c_str();
    if (process.clock_reference().size() == 0 || process.clock_error_ns() < 0 ||
        std::abs(ahead) < worth_a_word || !told.insert(host).second)
      continue;
    std::cerr << "invar record: stamps of host `" << printable(host) << "` are "
              << dds::seconds_text({std::abs(ahead)}) << (ahead < 0 ? " behind" : " ahead of")
              << " those of `" << printable(process.clock_reference().c_str())
              << "`: they are in the file as they were sent; the component `recorder` turns them\n";
  }
}

int record(RecordOptions& options) {
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found("invar record");
    return 1;
  }
  const auto wanted = [&](const std::string& topic) {
    if (!options.topics.empty())
      return std::any_of(options.topics.begin(), options.topics.end(), [&](const std::string& part) {
        return topic.find(part) != std::string::npos || topic == cell.topic(part);
      });
    return options.all || !is_service_topic(topic);
  };
  std::error_code ignored;  // what cannot be created is said by the writer
  if (options.out.has_parent_path()) std::filesystem::create_directories(options.out.parent_path(), ignored);
  if (const auto kept = recording::keep_earlier(options.out); !kept.empty())
    std::cerr << "the earlier " << options.out.string() << " is " << kept.string() << " now\n";
  recording::RecordingWriter file{options.out, {.reserve_bytes = 1'000'000 * options.reserve_mb}};
  recording::LossLedger ledger;
  bool disk_good = false;
  {
    Channels channels{file, cell.node().profiles()};
    TopicWatch watch{cell.node(), wanted, [&](const dds::Endpoint& end, const dds::RawSample& sample) {
                       channels.write(end, sample);
                     }};
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    std::optional<Clock::time_point> first;  // --duration counts from the first topic
    while (sleep_for(Duration::milliseconds(50))) {
      watch.look();
      const auto now = Clock::now();
      if (!first && watch.topics() > 0) {
        first = now;
        if (!options.json) std::cerr << "recording into " << options.out.string() << "; Ctrl-C ends it\n";
      }
      if (!first && now - begin > std::chrono::nanoseconds{cell.patience().ns}) break;
      if (first && options.duration > 0.0 &&
          std::chrono::duration<double>(now - *first).count() > options.duration)
        break;
      if (file.status().failed || file.status().at_reserve) break;
    }
  }
  tell_clocks(cell);
  const bool at_reserve = file.status().at_reserve;
  disk_good = file.close();
  ledger = file.ledger();
  report(ledger, options);
  if (at_reserve)
    std::cerr << "invar record: the disk has " << options.reserve_mb
              << " MB left, which are kept free for black boxes (--reserve-mb): the recording has ended\n";
  if (!disk_good) std::cerr << "invar record: the disk refused to take more\n";
  if (ledger.channels.empty())
    std::cerr << "invar record: no samples came; `invar topics` lists what there is\n";
  return disk_good && !at_reserve && !ledger.channels.empty() && ledger.total().lost == 0 ? 0 : 1;
}

}  // namespace

void add_record(CLI::App& program) {
  auto* command = program.add_subcommand("record", "Record topics of a running cell into an MCAP file");
  command->footer(
      "Example: invar record deployment/xy-table.yaml --out run.mcap --topic stage_x --duration 10\n"
      "Ctrl-C ends it and closes the file. Look into it with `invar recording info`.\n"
      "Exit status: 0 all that came is in the file; 1 nothing came, something was lost here, or the disk is "
      "full; 2 a fault of "
      "the "
      "call or the file");
  auto options = std::make_shared<RecordOptions>(*command);
  command
      ->add_option("--out", options->out,
                   "the file to write (.mcap); an earlier one is renamed: F-1.mcap, ...")
      ->required();
  command
      ->add_option("--reserve-mb", options->reserve_mb,
                   "end when the disk has no more than this free [MB] (64)")
      ->check(CLI::Range(0, 1'000'000));
  command
      ->add_option("--topic", options->topics,
                   "only topics that contain this text, or component.port; may stand several times")
      ->allow_extra_args(false);
  command->add_option("--duration", options->duration, "end after this time [s]")->check(positive());
  command->add_flag("--all", options->all, "also the topics by which processes are watched");
  command->add_flag("--json", options->json, "print the ledger as JSON");
  command->callback([options] {
    if (const int result = record(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
