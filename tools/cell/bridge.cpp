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
constexpr std::size_t most_waiting = 16;
}

struct Bridge::Line {
  struct Waiting {
    std::string writer;
    std::vector<std::byte> cdr;
  };
  bool newest_counts = false;
  Duration separation;
  std::mutex mutex;
  std::deque<Waiting> waiting;
  Instant next{INT64_MIN / 2};
  BridgeCount count;
  std::unique_ptr<dds::Inlet> check;
  std::unique_ptr<dds::Connection> writer, reader;

  void take(const dds::RawSample& sample) {
    const std::lock_guard lock{mutex};
    ++count.came;
    if (check->deliver(sample.cdr, utc_now(), std::string{sample.writer}) != dds::Inlet::Delivery::taken) {
      ++count.refused;
      return;
    }
    const auto same = std::find_if(waiting.begin(), waiting.end(),
                                   [&](const Waiting& one) { return one.writer == sample.writer; });
    if (newest_counts && same != waiting.end()) {
      same->cdr.assign(sample.cdr.begin(), sample.cdr.end());
      ++count.left_out;
    } else if (waiting.size() < most_waiting) {
      waiting.push_back({std::string{sample.writer}, {sample.cdr.begin(), sample.cdr.end()}});
    } else {
      ++count.left_out;
    }
  }

  void pass(Instant now) {
    const std::lock_guard lock{mutex};
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
    // Who commands is for the receiver to decide; here only what a sample is.
    dds::Profile any = qos;
    any.exclusive = false;
    any.lifespan = {};
    passing.check->guard(std::make_shared<dds::CommandGate>(read, any, from.discovery()),
                         dds::ExpectedKeys{cell_number, false, {}});
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
