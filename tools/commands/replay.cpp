// `invar replay`: publishes a recording's samples on their topics again, at any speed.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/clock.hpp"
#include "core/recording/replayer.hpp"
#include "tools/cell/replay_process.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct ReplayOptions {
  explicit ReplayOptions(CLI::App& command) : call{command, {{"FILE", "the recording (.mcap)"}}} {}
  CellCall call;
  std::vector<std::string> topics;
  double rate = 1.0;
  double from = 0.0;
  bool fast = false;
  bool beside = false;
  bool json = false;
  std::string process;
};

struct Channel {
  std::unique_ptr<dds::Connection> writer;
  std::uint64_t published = 0;
};

std::string type_of(const recording::Recording& file, const recording::mcap::Channel& channel) {
  const auto found = file.schemas().find(channel.schema_id);
  return found == file.schemas().end() ? "" : found->second.name;
}

/// The profile it was sent with, by the name that the recorder wrote; otherwise one that every reader accepts.
dds::Profile profile_of(const dds::Profiles& profiles, const recording::mcap::Channel& channel) {
  dds::Profile profile;
  if (const auto qos = channel.metadata.find("qos"); qos != channel.metadata.end())
    if (const auto found = profiles.find(qos->second); found != profiles.end()) profile = found->second;
  if (profile.name.empty()) {
    profile = profiles.at("state");
    profile.name = "replay";
  }
  profile.traffic = dds::Traffic::general;
  profile.flow = 0;
  profile.depth = std::max<std::int64_t>(profile.depth, 100);
  return profile;
}

bool is_wanted(const ReplayOptions& options, const std::string& topic) {
  return options.topics.empty() ||
         std::any_of(options.topics.begin(), options.topics.end(), [&](const std::string& part) {
           std::string path = part;  // `component.port` stands in the topic as component/port
           std::replace(path.begin(), path.end(), '.', '/');
           return topic.find(part) != std::string::npos || topic.ends_with("/" + path);
         });
}

/// Two writers of one topic are two truths: whoever writes one of ours already.
std::vector<std::string> written_already(LiveCell& cell, const std::set<std::string>& topics) {
  std::set<std::string> found;
  for (const auto& end : cell.node().snapshot().endpoints)
    if (end.is_writer && !end.is_local && topics.contains(end.topic)) found.insert(end.topic);
  return {found.begin(), found.end()};
}

/// The recording through the components of one process in simulated time.
int replay_into(const ReplayOptions& options) {
  if (options.call.file.empty())
    throw InputError{"--into", "needs the cell file", "name it instead of --domain"};
  const auto report = replay_process(options.call.file, options.process, options.call.word(0), interrupted);
  if (!report.failure.empty()) {
    std::cerr << "invar replay: " << report.failure << '\n';
    return 1;
  }
  TextTable table{{"output", "recorded>", "the same>", "first difference at [s]>", "which"}};
  nlohmann::ordered_json json{{"process", options.process},
                              {"fed", report.fed},
                              {"seconds", report.simulated_seconds},
                              {"absent_inputs", report.absent_inputs},
                              {"outputs", nlohmann::ordered_json::array()}};
  std::uint64_t recorded = 0;
  std::uint64_t equal = 0;
  for (const auto& output : report.outputs) {
    recorded += output.recorded;
    equal += output.equal;
    json["outputs"].push_back({{"topic", output.topic},
                               {"recorded", output.recorded},
                               {"equal", output.equal},
                               {"first_difference_ns", output.first_ns},
                               {"first_difference", output.first_difference}});
    table.add({output.topic, std::to_string(output.recorded), std::to_string(output.equal),
               output.first_ns < 0 ? "-" : number_text(static_cast<double>(output.first_ns) * 1e-9, 8),
               output.first_difference});
  }
  const int status = recorded > 0 && equal == recorded ? 0 : 1;
  if (options.json) {
    json["recorded"] = recorded;
    json["equal"] = equal;
    std::cout << json.dump(2) << '\n';
    return status;
  }
  table.print(std::cout);
  for (const auto& topic : report.absent_inputs) std::cout << "not recorded, so not fed: " << topic << '\n';
  std::cout << report.fed << " samples fed in " << number_text(report.simulated_seconds) << " s of the cell; "
            << equal << " of " << recorded << " recorded outputs came out the same\n";
  return status;
}

int replay(ReplayOptions& options) {
  options.call.resolve();
  if (!options.process.empty()) return replay_into(options);
  (void)interrupted();
  const auto file = recording::Recording::open(options.call.word(0));
  recording::Selection selection;
  for (const auto& [id, channel] : file.channels())
    if (is_wanted(options, channel.topic)) selection.topics.insert(channel.topic);
  if (selection.topics.empty())
    throw InputError{options.call.word(0), "has no such topic", "`invar recording info` lists its topics"};
  if (options.from > 0.0) selection.from = file.statistics().start + Duration::seconds(options.from);
  if (options.call.file.empty() && options.call.cell.empty()) options.call.cell = "replay";

  LiveCell cell{options.call, LiveCell::Need::nobody};
  std::map<std::string, Channel> channels;
  cell.settle();
  if (const auto taken = written_already(cell, selection.topics); !taken.empty() && !options.beside) {
    for (const std::string& topic : taken)
      std::cerr << "invar replay: `" << topic
                << "` is written already: a reader could not tell the two apart; stop that process, or add "
                   "--beside\n";
    return 1;
  }
  for (const auto& [id, channel] : file.channels())
    if (selection.topics.contains(channel.topic) && !channels.contains(channel.topic))
      channels[channel.topic].writer = cell.node().raw_writer(channel.topic, type_of(file, channel),
                                                              profile_of(cell.node().profiles(), channel));
  sleep_for(Duration::seconds(1.0));  // readers that are there connect

  const double speed = options.fast ? recording::Replayer::as_fast_as_possible : options.rate;
  recording::Replayer player{file.messages(selection), monotonic_now(), speed};
  std::uint64_t published = 0;
  while (const auto due = player.due()) {
    const Duration early = *due - monotonic_now();
    if (early.ns > 0 && !sleep_for(early)) break;
    if (interrupted()) break;
    while (const auto message = player.next(monotonic_now())) {
      const std::span bytes{reinterpret_cast<const std::byte*>(message->data.data()), message->data.size()};
      auto& channel = channels.at(message->channel->topic);
      if (channel.writer->write(&bytes)) {
        ++channel.published;
        ++published;
      }
    }
  }
  for (auto& [topic, channel] : channels) channel.writer->wait_for_acknowledgments(Duration::seconds(1.0));
  std::uint64_t refused = 0;
  TextTable table{{"topic", "published>", "readers>"}};
  auto topics = nlohmann::ordered_json::array();
  for (const auto& [topic, channel] : channels) {
    table.add({topic, std::to_string(channel.published), std::to_string(channel.writer->matched())});
    refused += channel.writer->lost();
    topics.push_back({{"topic", topic},
                      {"published", channel.published},
                      {"readers", channel.writer->matched()},
                      {"refused", channel.writer->lost()}});
  }
  if (options.json)
    std::cout << nlohmann::ordered_json{{"file", options.call.word(0)},
                                        {"published", published},
                                        {"refused", refused},
                                        {"topics", topics}}
                     .dump(2)
              << '\n';
  else
    table.print(std::cout);
  if (refused > 0) std::cerr << "invar replay: " << refused << " samples were refused by the middleware\n";
  return refused == 0 && published > 0 ? 0 : 1;
}

}  // namespace

void add_replay(CLI::App& program) {
  auto* command =
      program.add_subcommand("replay", "Publish a recording's samples on their topics again, at any speed");
  command->footer(
      "Example: invar replay deployment/xy-table.yaml run.mcap --topic stage_x/state --rate 2\n"
      "         invar replay --domain 71 run.mcap --fast\n"
      "         invar replay deployment/xy-table.yaml out/xy-table/recording.mcap --into motion\n"
      "Ctrl-C ends it. Topics that somebody writes now are refused, unless --beside is given.\n"
      "--into runs the components of a process again in simulated time, without DDS, on their recorded "
      "inputs.\n"
      "It compares their outputs with the recorded ones. The recording must be one of simulated time.\n"
      "Exit status: 0; 1 a topic is written already, samples were refused, or outputs differ; 2 a fault of "
      "the call or the "
      "file");
  auto options = std::make_shared<ReplayOptions>(*command);
  command
      ->add_option("--topic", options->topics, "only topics that contain this text; may stand several times")
      ->allow_extra_args(false);
  auto* rate = command->add_option("--rate", options->rate, "times as fast as it was (1)")
                   ->check(CLI::Range(1e-3, 1e6));
  command->add_option("--from", options->from, "leave out so much of the beginning [s]")
      ->check(CLI::Range(0.0, 1e9));
  command->add_flag("--fast", options->fast, "as fast as possible")->excludes(rate);
  command->add_flag("--beside", options->beside, "also topics that somebody writes now");
  command
      ->add_option("--into", options->process, "feed this process of the cell file, and compare its outputs")
      ->excludes(rate);
  command->add_flag("--json", options->json, "print what was published, or compared, as JSON");
  command->callback([options] {
    if (const int result = replay(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
