// `invar echo`: the samples of one topic, decoded by the IDL built in.
#include <condition_variable>
#include <deque>
#include <iomanip>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "core/recording/cdr.hpp"
#include "core/recording/type_book.hpp"
#include "core/recording/value_json.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct EchoOptions {
  explicit EchoOptions(CLI::App& command)
      : call{command, {{"TOPIC", "a topic's full name, or component.port"}}} {}
  CellCall call;
  std::size_t count = 0;
  bool json = false;
};

struct Arrived {
  std::vector<std::uint8_t> cdr;
  std::int64_t sent_ns = 0;
  std::uint64_t sequence = 0;
};

/// Between the middleware's threads and ours; keeps the newest when we are slower.
class Queue {
 public:
  void put(const dds::RawSample& sample) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(sample.cdr.data());
    const std::lock_guard lock{mutex_};
    if (waiting_.size() == 10'000) waiting_.pop_front();
    waiting_.push_back({{bytes, bytes + sample.cdr.size()}, sample.sent_ns, sample.sequence});
    news_.notify_one();
  }
  std::deque<Arrived> take() {
    std::unique_lock lock{mutex_};
    news_.wait_for(lock, std::chrono::milliseconds{50}, [this] { return !waiting_.empty(); });
    return std::exchange(waiting_, {});
  }

 private:
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Arrived> waiting_;
};

/// One field a line, indented by depth, with its unit.
void print_value(const recording::Value& value, const std::string& name, const std::string& unit, int depth) {
  const std::string lead(static_cast<std::size_t>(depth) * 2, ' ');
  if (value.type->kind == recording::Kind::structure) {
    std::cout << lead << name << ":\n";
    const auto& members = std::get<std::vector<recording::Value>>(value.content);
    for (std::size_t i = 0; i < members.size(); ++i)
      print_value(members[i], value.type->members[i].name, value.type->members[i].unit, depth + 1);
    return;
  }
  print_wrapped(lead + name + ": " + recording::to_json_line(recording::to_json(value)) +
                    (unit.empty() || unit == "1" ? "" : " " + unit),
                lead.size() + 2, std::cout);
}

/// The units of a type's fields, nested as its values are; only those that have one.
nlohmann::ordered_json units_of(const recording::Type& type) {
  const recording::Type* inner = &type;
  while (inner->element) inner = inner->element.get();
  auto units = nlohmann::ordered_json::object();
  for (const auto& member : inner->members) {
    if (auto below = units_of(*member.type); !below.empty())
      units[member.name] = std::move(below);
    else if (!member.unit.empty() && member.unit != "1")
      units[member.name] = member.unit;
  }
  return units;
}

void show(const dds::Endpoint& writer, const nlohmann::ordered_json& units, const Arrived& sample,
          const recording::Value& value, bool json) {
  if (json) {
    nlohmann::ordered_json line{{"topic", writer.topic},
                                {"type", writer.type},
                                {"sent_ns", sample.sent_ns},
                                {"sequence", sample.sequence}};
    line["value"] = recording::to_json(value);
    line["units"] = units;
    std::cout << recording::to_json_line(line) << std::endl;
    return;
  }
  std::cout << "sample " << sample.sequence << ", sent at " << sample.sent_ns << " ns\n";
  const auto& members = std::get<std::vector<recording::Value>>(value.content);
  for (std::size_t i = 0; i < members.size(); ++i)
    print_value(members[i], value.type->members[i].name, value.type->members[i].unit, 1);
  std::cout << std::flush;
}

int echo(EchoOptions& options) {
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found("invar echo");
    return 1;
  }
  const auto writers = cell.wait_for_writers(options.call.word(0));
  if (writers.empty()) {
    std::cerr << "invar echo: nobody writes `" << cell.topic(options.call.word(0)) << "` within "
              << cell.patience().in_seconds() << " s; `invar topics` lists what there is\n";
    return 1;
  }
  const auto* known = recording::built_in_type(writers.front().type);
  if (known == nullptr) {
    std::cerr << "invar echo: `" << writers.front().topic << "` carries " << writers.front().type
              << ", which is none of the built-in types\n";
    return 1;
  }
  Queue queue;
  const auto reader =
      cell.node().raw_reader(writers.front().topic, writers.front().type, reader_profile(writers),
                             [&](const dds::RawSample& sample) { queue.put(sample); });
  const auto units = units_of(*known->type);
  std::size_t shown = 0;
  bool good = true;
  while (!interrupted() && (options.count == 0 || shown < options.count))
    for (const Arrived& sample : queue.take()) {
      if (options.count != 0 && shown == options.count) break;
      ++shown;
      const auto value = recording::decode(*known->type, {sample.cdr.data(), sample.cdr.size()});
      if (value.ok()) {
        show(writers.front(), units, sample, value.value(), options.json);
      } else {
        std::cerr << "sample " << sample.sequence << ": " << recording::sentence(value.error()) << '\n';
        good = false;
      }
    }
  return good ? 0 : 1;
}

}  // namespace

void add_echo(CLI::App& program) {
  auto* command = program.add_subcommand("echo", "Print the samples of a topic as they come");
  command->footer(
      "Example: invar echo deployment/xy-table.yaml thermal.state --count 1\n"
      "         invar echo --domain 71 cell/xy_table/stage_x/state --json\n"
      "Ctrl-C ends it. Exit status: 0; 1 nobody writes the topic, or a sample cannot be read; 2 a fault of "
      "the "
      "call or the file");
  auto options = std::make_shared<EchoOptions>(*command);
  command->add_option("--count", options->count, "end after so many samples");
  command->add_flag("--json", options->json, "one JSON object a sample");
  command->callback([options] {
    if (const int result = echo(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
