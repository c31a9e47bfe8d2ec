#include "core/modbus/link.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <utility>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"

namespace invar::modbus {

namespace {

constexpr Duration byte_time = Duration::milliseconds(20);   // 11 bits at 600 baud take 18.3 ms
constexpr Duration long_idle = Duration::milliseconds(500);  // a gateway may have dropped the connection
constexpr unsigned silences_of_a_dead_link = 2;
constexpr unsigned closings_of_a_habit = 3;
constexpr Instant answered{INT64_MAX};      // a second answer to a request has no delay to learn from
constexpr std::size_t most_strays = 65536;  // a device that sends more without being asked is let go

/// Waits for `events` until `until`; false when they did not come.
bool wait_for(int socket, short events, Instant until) {
  for (;;) {
    const Duration left = std::max(until - monotonic_now(), Duration{0});
    const timespec span{left.ns / 1'000'000'000, left.ns % 1'000'000'000};
    pollfd watched{socket, events, 0};
    const int ready = ppoll(&watched, 1, &span, nullptr);
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

/// A connected socket, or -1 and errno.
int connected_socket(const addrinfo& to, Duration timeout) {
  const int socket = ::socket(to.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return -1;
  const int yes = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  setsockopt(socket, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
  int error = ::connect(socket, to.ai_addr, to.ai_addrlen) == 0 ? 0 : errno;
  if (error == EINPROGRESS) {
    socklen_t size = sizeof error;
    if (!wait_for(socket, POLLOUT, monotonic_now() + timeout))
      error = ETIMEDOUT;
    else if (getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size) != 0)
      error = errno;
  }
  if (error == 0) return socket;
  ::close(socket);
  errno = error;
  return -1;
}

Function read_function(Kind kind) {
  switch (kind) {
    case Kind::coil:
      return Function::read_coils;
    case Kind::discrete:
      return Function::read_discrete;
    case Kind::input:
      return Function::read_input;
    case Kind::holding:
      break;
  }
  return Function::read_holding;
}

}  // namespace

std::string_view name_of(Cause cause) {
  constexpr std::array<std::string_view, 7> names{"refused",      "unreachable",      "timeout",  "reset",
                                                  "short answer", "malformed answer", "exception"};
  return names[static_cast<std::size_t>(cause)];
}

Link::Link(std::string host, std::uint16_t port) : host_{std::move(host)}, service_{std::to_string(port)} {}
Link::~Link() { close(); }

Outcome Link::open(Duration timeout) {
  INVAR_EXPECTS(!is_open());
  connect_timeout_ = timeout;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  errno = 0;
  if (getaddrinfo(host_.c_str(), service_.c_str(), &hints, &found) == 0) {
    const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> all{found, &freeaddrinfo};
    for (const addrinfo* one = found; one != nullptr && !is_open(); one = one->ai_next)
      socket_ = connected_socket(*one, timeout);
  }
  if (is_open()) {
    ++counters_.connects;
    return std::nullopt;
  }
  const bool refused = errno == ECONNREFUSED;
  ++(refused ? counters_.refused : counters_.unreachable);
  return Failure{refused ? Cause::refused : Cause::unreachable};
}

void Link::close() {
  if (is_open()) ::close(socket_);
  socket_ = -1;
  received_.clear();
  asked_ = answers_ = 0;
  silences_ = 0;
}

void Link::address(std::uint8_t unit, Duration answer_timeout) {
  unit_ = unit;
  answer_timeout_ = answer_timeout;
}

Outcome Link::read(Kind kind, std::uint16_t address, std::span<std::uint16_t> words) {
  return ask({0, unit_, read_function(kind), address, static_cast<std::uint16_t>(words.size()), {}}, words);
}

Outcome Link::write(Kind kind, std::uint16_t address, std::span<const std::uint16_t> words, bool multiple) {
  INVAR_EXPECTS(kind == Kind::coil || kind == Kind::holding);
  INVAR_EXPECTS(!words.empty() && words.size() <= 2, words.size());
  Question question{0, unit_, Function::write_coil, address, static_cast<std::uint16_t>(words.size()), {}};
  std::copy(words.begin(), words.end(), question.values.begin());
  if (kind == Kind::coil)
    question.function = multiple ? Function::write_coils : Function::write_coil;
  else
    question.function = multiple || words.size() > 1 ? Function::write_registers : Function::write_register;
  return ask(question, {});
}

Outcome Link::ask(Question question, std::span<std::uint16_t> words) {
  // A device that closes after each answer, or while idle, may do so just when a request is on its way. A read is harmless
  // and asked again on a new connection, once; a write is not.
  bool again = !question.is_write();
  for (;;) {
    if (const auto failed = ready()) {
      ++counters_.losses;
      return failed;
    }
    again = again && (answers_ == 1 || (answers_ > 1 && monotonic_now() - last_answer_ > long_idle));
    question.transaction = ++transaction_;
    const std::uint64_t answers = answers_;
    const auto failed = exchange(question, words);
    if (!failed || failed->cause == Cause::exception) {
      last_answer_ = monotonic_now();
      if (counters_.one_answer) close();  // leaves it to others
      return failed;
    }
    if (failed->cause == Cause::reset && answers == 1) note_closing();
    if (failed->cause == Cause::reset && std::exchange(again, false)) continue;
    if (!is_open()) ++counters_.losses;
    return failed;
  }
}

/// Makes the link fit for a request: a connection, and nothing on it that would be taken for the answer.
Outcome Link::ready() {
  if (is_open() && !drop_strays()) {
    ++counters_.closings;
    if (answers_ == 1)
      note_closing();
    else
      single_answers_ = 0;
    close();
  }
  return is_open() ? std::nullopt : open(connect_timeout_);
}

void Link::note_closing() {
  if (++single_answers_ >= closings_of_a_habit) counters_.one_answer = true;
}

/// Throws away what came without being asked for; false when the device has closed the connection.
bool Link::drop_strays() {
  std::array<std::uint8_t, 4096> bytes;
  bool open = true;
  while (open) {
    const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), 0);
    if (size > 0) received_.insert(received_.end(), bytes.begin(), bytes.begin() + size);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno == EAGAIN) break;
    open = size > 0 && received_.size() <= most_strays;
  }
  std::span<const std::uint8_t> rest{received_};
  for (Head head = first_frame(rest); head.length > 0 && was_asked(head.transaction);
       head = first_frame(rest)) {
    note_late(head.transaction);
    rest = rest.subspan(head.length);
  }
  if (!rest.empty()) ++counters_.stray;
  received_.clear();
  return open;
}

bool Link::was_asked(std::uint16_t transaction) const {
  const auto before = static_cast<std::uint16_t>(transaction_ - transaction);
  return before < std::min<std::uint64_t>(asked_, remembered);
}

void Link::note_late(std::uint16_t transaction) {
  ++counters_.late;
  silences_ = 0;
  const Instant asked = asked_at_[transaction % remembered];
  if (asked != answered) counters_.latest = std::max(counters_.latest, monotonic_now() - asked);
}

/// What the device has not got yet it gets no more: when the link is back, somebody else may command it.
Outcome Link::lost(Cause cause, Flaw flaw) {
  const linger at_once{1, 0};
  if (is_open()) (void)setsockopt(socket_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  close();
  return Failure{cause, 0, flaw};
}

Outcome Link::send(const Question& question, Instant until) {
  Frame frame;
  std::span<const std::uint8_t> rest{frame.data(), write_frame(question, frame)};
  while (!rest.empty()) {
    const ssize_t size = ::send(socket_, rest.data(), rest.size(), MSG_NOSIGNAL);
    if (size >= 0) {
      rest = rest.subspan(static_cast<std::size_t>(size));
    } else if (errno == EAGAIN) {
      if (!wait_for(socket_, POLLOUT, until)) return lost(Cause::timeout);
    } else if (errno != EINTR) {
      return lost(Cause::reset);
    }
  }
  return std::nullopt;
}

Outcome Link::exchange(const Question& question, std::span<std::uint16_t> words) {
  const Instant sent = monotonic_now();
  const Instant end = sent + answer_timeout_ + byte_time * static_cast<std::int64_t>(answer_length(question));
  Instant until = sent + answer_timeout_;
  asked_at_[question.transaction % remembered] = sent;
  ++asked_;
  if (const auto failed = send(question, until)) return failed;
  for (;;) {
    if (auto outcome = look(question, words)) return *outcome;
    if (!wait_for(socket_, POLLIN, until) || monotonic_now() >= end) break;
    std::array<std::uint8_t, 1024> bytes;
    const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), 0);
    if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (size <= 0) return lost(received_.empty() ? Cause::reset : Cause::short_answer);
    received_.insert(received_.end(), bytes.begin(), bytes.begin() + size);
    silences_ = 0;
    until = std::min(end, monotonic_now() + answer_timeout_);
  }
  if (!received_.empty()) return lost(Cause::short_answer);
  // A late answer will be told by its transaction; a link without a sign of life is made anew.
  if (++silences_ >= silences_of_a_dead_link) return lost(Cause::timeout);
  return Failure{Cause::timeout};
}

std::optional<Outcome> Link::look(const Question& question, std::span<std::uint16_t> words) {
  for (;;) {
    const Head head = first_frame(received_);
    if (head.flaw != Flaw::none) return lost(Cause::malformed, head.flaw);
    if (head.length == 0) return std::nullopt;
    const std::span frame{received_.data(), head.length};
    if (head.transaction != question.transaction) {
      if (!was_asked(head.transaction)) return lost(Cause::malformed, Flaw::transaction);
      note_late(head.transaction);
      received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(head.length));
      continue;
    }
    const Judgement judgement = judge(question, frame, words);
    if (judgement.flaw != Flaw::none) return lost(Cause::malformed, judgement.flaw);
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(head.length));
    ++answers_;
    silences_ = 0;
    asked_at_[question.transaction % remembered] = answered;
    if (judgement.exception != 0) return Outcome{Failure{Cause::exception, judgement.exception}};
    return Outcome{};
  }
}

}  // namespace invar::modbus
