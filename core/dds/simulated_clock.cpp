#include "core/dds/simulated_clock.hpp"

#include <algorithm>
#include <chrono>
#include <random>
#include <set>

#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/dds/command_gate.hpp"
#include "core/dds/typed_wire.hpp"

namespace invar::dds {

namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
constexpr std::size_t part_size = 1U << 20U;  // the bound of samples in one message
constexpr std::size_t most_outside =
    4096;  // samples from outside in one window: a flood takes no more memory

SteadyTime after(Duration patience) {
  return std::chrono::steady_clock::now() + std::chrono::nanoseconds{patience.ns};
}

/// Sends `message` in as many parts as `bytes` need, one at least.
template <typename Message>
void write_in_parts(Writer<Message>& writer, Message& message, const std::vector<std::uint8_t>& bytes) {
  std::size_t begin = 0;
  do {
    const std::size_t end = std::min(bytes.size(), begin + part_size);
    message.samples().assign(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                             bytes.begin() + static_cast<std::ptrdiff_t>(end));
    message.last(end == bytes.size());
    writer.write(message);
    begin = end;
  } while (begin < bytes.size());
}

/// An answer stays available to a master that connects late; a window needs no more than these parts.
Profile answers_profile() {
  Profile p;
  p.name = "lockstep";
  p.reliable = true;
  p.depth = 256;
  p.durability = Durability::transient_local;
  p.max_instances = 64;
  p.blocking = Duration::milliseconds(10'000);
  p.asks_at_once = false;
  return p;
}

Profile grants_profile() {
  Profile p = answers_profile();
  p.durability = Durability::volatile_;
  return p;
}

std::string topic_of(const Node& node, const char* what) {
  return "cell/" + node.options().cell + "/lockstep/" + what;
}

}  // namespace

std::uint32_t name_number(std::string_view name) {
  std::uint32_t hash = 2166136261U;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return hash;
}

void ReachedBoard::put(const lockstep::TimeReached& part) {
  const std::lock_guard lock{mutex_};
  Window& window = windows_[{part.run(), part.sequence_number()}];
  Entry& entry = window.partial[part.process_id()];
  entry.samples.insert(entry.samples.end(), part.samples().begin(), part.samples().end());
  entry.finished = part.finished();
  entry.failure = part.failure().c_str();
  if (!part.last()) return;
  window.complete.insert_or_assign(part.process_id(), std::move(entry));
  window.partial.erase(part.process_id());
  if (window.complete.size() >= awaited_) news_.notify_all();
}

std::optional<std::vector<ReachedBoard::Entry>> ReachedBoard::wait(
    std::uint64_t run, std::uint64_t sequence, const std::vector<std::uint32_t>& processes, Duration patience,
    const std::function<bool()>& given_up) {
  std::unique_lock lock{mutex_};
  awaited_ = processes.size();
  const std::pair key{run, sequence};
  const auto complete = [&] {
    const auto& there = windows_[key].complete;
    return std::all_of(processes.begin(), processes.end(), [&](auto p) { return there.contains(p); });
  };
  const auto end = after(patience);
  while (!complete()) {
    if (std::chrono::steady_clock::now() > end || (given_up && given_up())) return std::nullopt;
    news_.wait_for(lock, std::chrono::milliseconds{50});
  }
  std::vector<Entry> entries;
  for (const auto process : processes) entries.push_back(std::move(windows_[key].complete[process]));
  // What is older, of this run or of one before it, nobody asks for again.
  std::erase_if(windows_, [&](const auto& w) { return w.first.first != run || w.first.second <= sequence; });
  return entries;
}

std::vector<std::uint32_t> ReachedBoard::missing(std::uint64_t run, std::uint64_t sequence,
                                                 const std::vector<std::uint32_t>& processes) const {
  const std::lock_guard lock{mutex_};
  const auto window = windows_.find({run, sequence});
  std::vector<std::uint32_t> out;
  for (const auto process : processes)
    if (window == windows_.end() || !window->second.complete.contains(process)) out.push_back(process);
  return out;
}

SimulatedClockMaster::SimulatedClockMaster(Node& node, std::vector<std::string> processes, Duration window)
    : names_{std::move(processes)},
      window_{window},
      run_{(std::uint64_t{std::random_device{}()} << 32U) | std::random_device{}()},
      writer_{node.writer<lockstep::TimeGrant>(topic_of(node, "grant"), grants_profile())} {
  INVAR_EXPECTS(window.ns > 0 && !names_.empty() && names_.size() <= 64, window.ns, names_.size());
  for (const auto& name : names_) numbers_.push_back(name_number(name));
  reader_ =
      node.reader<lockstep::TimeReached>(topic_of(node, "reached"), answers_profile(),
                                         [this](const lockstep::TimeReached& part) { board_.put(part); });
}

void SimulatedClockMaster::grant(lockstep::GrantKind kind, Instant until) {
  lockstep::TimeGrant sample;
  sample.kind(kind);
  sample.run(run_);
  sample.sequence_number(sequence_);
  sample.from_ns(now_.ns);
  sample.until_ns(until.ns);
  sample.processes(numbers_);
  write_in_parts(writer_, sample,
                 kind == lockstep::GRANT_JOIN ? std::vector<std::uint8_t>{} : answered_.bytes());
}

void SimulatedClockMaster::keep(const std::vector<ReachedBoard::Entry>& answers) {
  answered_.clear();
  for (std::uint32_t i = 0; i < answers.size(); ++i)
    answered_.add(i, std::as_bytes(std::span{answers[i].samples}));
}

std::string SimulatedClockMaster::names_of(const std::vector<std::uint32_t>& numbers) const {
  std::string text;
  for (std::size_t i = 0; i < numbers_.size(); ++i)
    if (std::find(numbers.begin(), numbers.end(), numbers_[i]) != numbers.end())
      text += (text.empty() ? "" : ", ") + names_[i];
  return text;
}

std::string SimulatedClockMaster::wait_for_all(Duration patience, const std::function<bool()>& given_up) {
  const auto end = after(patience);
  while (std::chrono::steady_clock::now() < end && !(given_up && given_up())) {
    grant(lockstep::GRANT_JOIN, now_);
    if (const auto answers = board_.wait(run_, 0, numbers_, Duration::milliseconds(20), given_up)) {
      keep(*answers);
      // Fast DDS 2.9 may keep a sample for ever that was written while a reader was being matched. From then on every message
      // tells every reader of all that is gone since (a GAP that it walks through number by number): an hour of simulated time
      // came to a standstill.
      writer_.connection().forget();
      return "";
    }
  }
  return "these processes did not join simulated time: " + names_of(board_.missing(run_, 0, numbers_));
}

Advance SimulatedClockMaster::advance_to(Instant until, Duration patience,
                                         const std::function<bool()>& given_up) {
  while (now_ < until) {
    const Instant next = std::min(until, now_ + window_);
    ++sequence_;
    grant(lockstep::GRANT_RUN, next);
    answered_.clear();
    const auto answers = board_.wait(run_, sequence_, numbers_, patience, given_up);
    if (!answers)
      return {now_, false,
              "these processes did not reach " + std::to_string(next.in_seconds()) +
                  " s of simulated time: " + names_of(board_.missing(run_, sequence_, numbers_))};
    now_ = next;
    keep(*answers);
    for (std::size_t i = 0; i < answers->size(); ++i)
      if (!(*answers)[i].failure.empty()) return {now_, false, names_[i] + ": " + (*answers)[i].failure};
    if (std::all_of(answers->begin(), answers->end(), [](const auto& a) { return a.finished; }))
      return {now_, true, ""};
  }
  return {now_, false, ""};
}

void SimulatedClockMaster::end() {
  grant(lockstep::GRANT_END, now_);
  (void)writer_.connection().wait_for_acknowledgments(Duration::milliseconds(1000));
}

SimulatedClockClient::SimulatedClockClient(Node& node)
    : node_{node},
      number_{name_number(node.options().process)},
      writer_{node.writer<lockstep::TimeReached>(topic_of(node, "reached"), answers_profile())} {
  membership_.process = node.options().process;
  reader_ = node.reader<lockstep::TimeGrant>(topic_of(node, "grant"), grants_profile(),
                                             [this](const lockstep::TimeGrant& grant) { put(grant); });
}

void SimulatedClockClient::put(const lockstep::TimeGrant& part) {
  const std::lock_guard lock{mutex_};
  part_.insert(part_.end(), part.samples().begin(), part.samples().end());
  if (!part.last()) return;
  grants_.push_back({part, std::move(part_)});
  part_.clear();
  news_.notify_one();
}

void SimulatedClockClient::bind(OutputPort& port, Duration separation) {
  const WireType* type = WireTypes::all().find(port.type());
  if (type == nullptr)
    throw InputError{"topic `" + port.topic + "`", "carries a type that no IDL describes", "add it to idl/"};
  const auto number = static_cast<std::uint32_t>(membership_.written.size());
  membership_.written.push_back({port.topic, type->name()});
  const bool& wanted = wanted_.emplace_back(false);
  type->attach_cdr(
      port,
      [&wanted, &port, thinning = Thinning{separation}]() mutable {
        return wanted && thinning.passes(port.owner().now());
      },
      [this, number](std::span<const std::byte> cdr) { bundle_.add(number, cdr); });

  Profile outside = node_.profile(port.profile);
  outside.reliable = true;
  outside.keep_all = true;
  outside.depth = 1000;
  outside.lifespan = {};
  outside.flow = 0;
  outside.blocking = Duration::milliseconds(10'000);
  node_.bind(port, {.period = {}, .separation = separation, .watched_only = true}, outside);
}

void SimulatedClockClient::bind(InputPort& port) {
  const WireType* type = WireTypes::all().find(port.type());
  if (type == nullptr)
    throw InputError{"topic `" + port.topic + "`", "carries a type that no IDL describes", "add it to idl/"};
  const Profile& profile = node_.profile(port.profile);
  const auto refused = [&port] { port.refuse(); };
  Binding input{port.topic, type->attach(port, false), type->name(), port.profile, &port, {}, {}};
  input.gate = std::make_shared<CommandGate>(port.topic, profile, node_.discovery(), refused);
  input.probe = type->attach([](const void*, Instant) {}, false);
  for (const auto& inlet : {input.inlet, input.probe}) inlet->guard(input.gate, expected_keys(port));
  inputs_.push_back(std::move(input));
  membership_.wanted.push_back(port.topic);
}

/// What the cell's own processes write comes in bundles; by DDS it is heard a second time, and not listened to.
void SimulatedClockClient::listen_outside() {
  std::set<std::string> heard;
  const std::string own = "invar/" + node_.options().cell + "/";
  for (const auto& input : inputs_) {
    if (input.port->direction() != Port::Direction::inbox || !heard.insert(input.topic).second) continue;
    outside_readers_.push_back(
        node_.raw_reader(input.topic, input.type, node_.profile(input.profile),
                         [this, topic = input.topic, own](const RawSample& sample) {
                           Discovery& discovery = node_.discovery();
                           const auto who = discovery.claimant(std::string{sample.writer});
                           if (discovery.participant_name(who.participant).starts_with(own)) return;
                           for (const auto& one : inputs_)
                             if (one.topic == topic) take_outside(one, sample);
                         }));
  }
}

/// Keeps what this input takes until the next window; what is malformed is a stranger's.
void SimulatedClockClient::take_outside(const Binding& input, const RawSample& sample) {
  const std::string writer{sample.writer};
  if (input.probe->deliver(sample.cdr, {}, writer) != Inlet::Delivery::taken) return;
  if (input.gate->is_asked_of_all() && !input.gate->passes(writer, {sample.sent_ns})) return;
  const std::lock_guard lock{mutex_};
  if (outside_.size() == most_outside) return input.port->refuse();
  outside_.push_back({writer, input.inlet.get(), {sample.cdr.begin(), sample.cdr.end()}});
}

void SimulatedClockClient::deliver_outside(Instant at) {
  std::vector<FromOutside> came;
  {
    const std::lock_guard lock{mutex_};
    came.swap(outside_);
  }
  for (const auto& sample : came) (void)sample.inlet->deliver(sample.cdr, at, sample.writer);
}

void SimulatedClockClient::tap(std::function<void(const LockstepSample&)> sink) {
  tap_ = std::move(sink);
  membership_.wanted.emplace_back("*");
}

std::optional<SimulatedClockClient::Grant> SimulatedClockClient::next_grant(const std::atomic<bool>& stop,
                                                                            Duration patience) {
  std::unique_lock lock{mutex_};
  const auto end = after(patience);
  while (grants_.empty()) {
    if (stop || std::chrono::steady_clock::now() > end) return std::nullopt;
    news_.wait_for(lock, std::chrono::milliseconds{50});
  }
  auto grant = std::move(grants_.front());
  grants_.pop_front();
  return grant;
}

SimulatedClockClient::Run SimulatedClockClient::run(const std::function<std::string(Instant until)>& advance,
                                                    const std::function<bool()>& is_finished,
                                                    const std::atomic<bool>& stop, Duration patience) {
  for (;;) {
    const auto grant = next_grant(stop, patience);
    if (!grant) return {false, stop ? "" : "no simulated time was granted for too long"};
    const bool of_this_run = grant->head.run() == run_;
    switch (grant->head.kind()) {
      case lockstep::GRANT_JOIN:
        if (!of_this_run) join(grant->head);
        break;
      case lockstep::GRANT_END:
        if (!of_this_run) break;
        // Ports get nothing any more, but a recorder wants the last window too.
        return {true, tap_ && grant->head.sequence_number() > 0 ? deliver_all(*grant) : ""};
      case lockstep::GRANT_RUN: {
        if (!of_this_run) break;
        bundle_.clear();
        std::string failure = deliver_all(*grant);
        deliver_outside({grant->head.from_ns()});
        if (failure.empty()) failure = advance({grant->head.until_ns()});
        answer(grant->head, bundle_.bytes(), is_finished(), failure);
        break;
      }
    }
  }
}

void SimulatedClockClient::join(const lockstep::TimeGrant& grant) {
  run_ = grant.run();
  peers_.clear();
  std::fill(wanted_.begin(), wanted_.end(), false);
  answer(grant, write_membership(membership_), false, "");
}

void SimulatedClockClient::learn(std::uint32_t process, const Membership& membership) {
  Peer& peer = peers_[process];
  peer.name = membership.process;
  peer.topics = membership.written;
  peer.counts.assign(peer.topics.size(), 0);
  peer.inlets.assign(peer.topics.size(), {});
  // Signals of one process are joined by its executor and not bound here; an inbox, or the tap, hears its own process
  // as any other.
  for (std::size_t i = 0; i < peer.topics.size(); ++i)
    for (const auto& input : inputs_)
      if (input.topic == peer.topics[i].topic) peer.inlets[i].push_back(input.inlet.get());
  for (const auto& topic : membership.wanted)
    for (std::size_t i = 0; i < membership_.written.size(); ++i)
      if (topic == "*" || topic == membership_.written[i].topic) wanted_[i] = true;
}

bool SimulatedClockClient::deliver(std::uint32_t process, std::span<const std::uint8_t> bundle, Instant at) {
  Peer& peer = peers_[process];
  bool good = true;
  good &= read_bundle(bundle, [&](std::uint32_t number, std::span<const std::byte> cdr) {
    if (number >= peer.topics.size()) {
      good = false;
      return;
    }
    for (Inlet* inlet : peer.inlets[number])
      good &= inlet->deliver(cdr, at, peer.name) != Inlet::Delivery::malformed;
    ++peer.counts[number];
    if (tap_) tap_({peer.name, peer.topics[number], peer.counts[number], at, cdr});
  });
  return good;
}

std::string SimulatedClockClient::deliver_all(const Grant& grant) {
  const auto& processes = grant.head.processes();
  // Before the first window everybody said who they are.
  const bool members = grant.head.kind() == lockstep::GRANT_RUN && grant.head.sequence_number() == 1;
  bool good = true;
  good &= read_bundle(grant.samples, [&](std::uint32_t position, std::span<const std::byte> answer) {
    if (position >= processes.size()) {
      good = false;
      return;
    }
    const std::span bytes{reinterpret_cast<const std::uint8_t*>(answer.data()), answer.size()};
    if (members)
      learn(processes[position], read_membership({bytes.begin(), bytes.end()}));
    else
      good &= deliver(processes[position], bytes, {grant.head.from_ns()});
  });
  return good ? "" : "malformed samples of another process";
}

void SimulatedClockClient::answer(const lockstep::TimeGrant& grant, const std::vector<std::uint8_t>& samples,
                                  bool finished, const std::string& failure) {
  lockstep::TimeReached part;
  part.cell(grant.cell());
  part.process_id(number_);
  part.run(run_);
  part.sequence_number(grant.sequence_number());
  part.finished(finished);
  part.failure(failure);
  write_in_parts(writer_, part, samples);
}

}  // namespace invar::dds
