#include "tools/cell/bridge.hpp"

#include <algorithm>
#include <deque>
#include <mutex>
#include <span>

#include "core/base/clock.hpp"
#include "core/dds/command_gate.hpp"
#include "core/dds/wire_type.hpp"

namespace invar::tools {

namespace {
constexpr std::ptrdiff_t most_of_writer = 16;
constexpr std::size_t most_waiting = 256;
}  // namespace

struct Bridge::Line {
  struct Waiting {
    std::string writer;
    std::vector<std::byte> cdr;
    Instant came;
  };
  bool newest_counts = false;
  Duration separation, lifespan;
  std::mutex mutex;
  std::deque<Waiting> waiting;
  Instant next{INT64_MIN / 2};
  BridgeCount count;
  std::unique_ptr<dds::Inlet> check;
  std::shared_ptr<dds::CommandGate> gate;
  std::unique_ptr<dds::Connection> writer, reader;

  void take(const dds::RawSample& sample) {
    const std::lock_guard lock{mutex};
    ++count.came;
    const std::string writer_id{sample.writer};
    if (check->deliver(sample.cdr, utc_now(), writer_id) != dds::Inlet::Delivery::taken ||
        !gate->passes(writer_id, {sample.sent_ns})) {
      ++count.refused;
      return;
    }
    const auto is_same = [&](const Waiting& one) { return one.writer == writer_id; };
    const auto same = std::find_if(waiting.begin(), waiting.end(), is_same);
    const auto of_writer = std::count_if(waiting.begin(), waiting.end(), is_same);
    if (newest_counts && same != waiting.end()) {
      same->cdr.assign(sample.cdr.begin(), sample.cdr.end());
      same->came = monotonic_now();
      ++count.left_out;
    } else if (of_writer < most_of_writer && waiting.size() < most_waiting) {
      waiting.push_back({writer_id, {sample.cdr.begin(), sample.cdr.end()}, monotonic_now()});
    } else {
      ++count.left_out;
    }
  }

  void pass(Instant now) {
    const std::lock_guard lock{mutex};
    // An order that waited too long would be obeyed as a new one.
    if (lifespan.ns > 0)
      count.left_out += std::erase_if(waiting, [&](const Waiting& one) { return now - one.came > lifespan; });
    if (waiting.empty() || now < next) return;
    const std::span<const std::byte> cdr{waiting.front().cdr};
    ++(writer->write(&cdr) ? count.passed : count.refused);
    waiting.pop_front();
    next = now + separation;
  }
};

Bridge::Bridge(const BridgeFile& file, std::uint32_t cell_number, dds::Node& cell, dds::Node& plant) {
  for (const BridgeLine& line : file.lines) {
    const bool is_out = line.direction == Direction::out;
    dds::Node &from = is_out ? cell : plant, &to = is_out ? plant : cell;
    const std::string &read = is_out ? line.cell_topic : line.plant_topic,
                      &written = is_out ? line.plant_topic : line.cell_topic;
    dds::Profile qos = cell.profile(line.profile);
    if (is_out) qos.deadline = {};  // the rate of a line may be lower
    Line& passing = *lines_.emplace_back(std::make_unique<Line>());
    passing.newest_counts = qos.depth == 1 && !qos.keep_all;
    passing.separation = Duration::seconds(1.0 / line.rate);
    passing.check =
        dds::WireTypes::all().find(std::string_view{line.type})->attach([](const void*, Instant) {}, false);
    // Who commands is for the receiver to decide; here only what a sample is, and how old.
    dds::Profile any = qos;
    any.exclusive = false;
    passing.lifespan = qos.lifespan;
    passing.gate = std::make_shared<dds::CommandGate>(read, any, from.discovery());
    passing.check->guard(passing.gate, dds::ExpectedKeys{cell_number, false, {}});
    passing.writer = to.raw_writer(written, line.type, qos);
    passing.reader = from.raw_reader(read, line.type, qos,
                                     [&passing](const dds::RawSample& sample) { passing.take(sample); });
  }
}

Bridge::~Bridge() {
  for (const auto& line : lines_) line->reader.reset();
}

void Bridge::pass() {
  const Instant now = monotonic_now();
  for (const auto& line : lines_) line->pass(now);
}

BridgeCount Bridge::count(std::size_t line) const {
  const std::lock_guard lock{lines_[line]->mutex};
  return lines_[line]->count;
}

}  // namespace invar::tools
