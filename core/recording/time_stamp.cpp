#include "core/recording/time_stamp.hpp"

#include <cctype>
#include <charconv>

namespace invar::recording {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000, minute_ns = 60 * second_ns, hour_ns = 60 * minute_ns,
                       day_ns = 24 * hour_ns;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Takes an integer of `least` to `most` digits off the front.
std::optional<int> take(std::string_view& text, std::size_t least, std::size_t most) {
  std::size_t digits = 0;
  while (digits < text.size() && is_digit(text[digits])) ++digits;
  if (digits < least || digits > most) return std::nullopt;
  int value = 0;
  std::from_chars(text.data(), text.data() + digits, value);
  text.remove_prefix(digits);
  return value;
}

bool take(std::string_view& text, char mark) {
  if (text.empty() || text.front() != mark) return false;
  text.remove_prefix(1);
  return true;
}

/// Days since 1970-01-01 of the Gregorian calendar (Fliegel and Van Flandern, 1968); nothing where there is no such day.
std::optional<std::int64_t> days_of(int y, int m, int d) {
  constexpr int lengths[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  constexpr int earliest = 1700, latest = 2261;  // nanoseconds since 1970 fit into 64 bits
  if (m < 1 || m > 12 || d < 1 || y < earliest || y > latest) return std::nullopt;
  const bool leap = (y % 4 == 0 && y % 100 != 0) || y % 400 == 0;
  if (d > lengths[m - 1] + (m == 2 && leap ? 1 : 0)) return std::nullopt;
  const std::int64_t a = (m - 14) / 12;
  return (1461 * (y + 4800 + a)) / 4 + (367 * (m - 2 - 12 * a)) / 12 - (3 * ((y + 4900 + a) / 100)) / 4 + d -
         32075 - 2'440'588;
}

/// Takes a date off the front: its days since 1970.
std::optional<std::int64_t> take_date(std::string_view& text, bool& ambiguous) {
  auto rest = text;
  const auto first = take(rest, 1, 4);
  if (!first || rest.empty()) return std::nullopt;
  const bool year_first = text.size() - rest.size() == 4;
  const char mark = rest.front();
  if (mark != '-' && mark != '/' && mark != '.') return std::nullopt;
  rest.remove_prefix(1);
  const auto second = take(rest, 1, 2);
  if (!second || !take(rest, mark)) return std::nullopt;
  const auto third = year_first ? take(rest, 1, 2) : take(rest, 4, 4);
  if (!third || text.size() - rest.size() < 8) return std::nullopt;
  text = rest;
  if (year_first) return days_of(*first, *second, *third);
  const bool month_first = mark != '.' && *second > 12;
  ambiguous = mark != '.' && *first <= 12 && *second <= 12 && *first != *second;
  return month_first ? days_of(*third, *first, *second) : days_of(*third, *second, *first);
}

/// Takes hh:mm, hh:mm:ss or hh:mm:ss.fff off the front; `seconds` where they must be there.
std::optional<std::int64_t> take_time(std::string_view& text, bool seconds) {
  const auto hour = take(text, 1, 2);
  if (!hour || *hour > 24 || !take(text, ':')) return std::nullopt;
  const auto minute = take(text, 2, 2);
  if (!minute || *minute > 59) return std::nullopt;
  std::int64_t ns = *hour * hour_ns + *minute * minute_ns;
  if (!take(text, ':')) return seconds ? std::nullopt : std::optional{ns};
  const auto second = take(text, 2, 2);
  if (!second || *second > 60) return std::nullopt;  // 60: a leap second
  ns += *second * second_ns;
  if (text.empty() || (text.front() != '.' && text.front() != ',')) return ns;
  text.remove_prefix(1);
  if (text.empty() || !is_digit(text.front())) return std::nullopt;
  for (std::int64_t unit = second_ns / 10; !text.empty() && is_digit(text.front()); unit /= 10) {
    ns += unit * (text.front() - '0');
    text.remove_prefix(1);
  }
  return ns;
}

/// Takes `Z`, `UTC`, `+01:00`, `-0530` or nothing off the front: what its clocks are ahead.
std::optional<std::int64_t> take_zone(std::string_view& text) {
  while (take(text, ' ')) continue;
  if (text.empty() || text == "Z" || text == "z" || text == "UTC" || text == "GMT") {
    text = {};
    return 0;
  }
  const bool ahead = text.front() == '+';
  if (!ahead && text.front() != '-') return std::nullopt;
  text.remove_prefix(1);
  const auto digits = text.substr(0, 2);
  auto two = digits;
  const auto hours = take(two, 2, 2);
  if (!hours) return std::nullopt;
  text.remove_prefix(2);
  (void)take(text, ':');
  const auto minutes = text.empty() ? std::optional{0} : take(text, 2, 2);
  if (!minutes) return std::nullopt;
  return (ahead ? 1 : -1) * (*hours * hour_ns + *minutes * minute_ns);
}

}  // namespace

std::optional<TimeStamp> parse_time_stamp(std::string_view cell) {
  TimeStamp stamp;
  auto rest = cell;
  bool ambiguous = false;
  const auto days = take_date(rest, ambiguous);
  stamp.has_date = days.has_value();
  if (days) {
    stamp.ns = *days * day_ns;
    if (ambiguous) stamp.ambiguous = cell.substr(0, cell.size() - rest.size());
    if (rest.empty()) return stamp;
    if (std::string_view{"Tt -_"}.find(rest.front()) == std::string_view::npos) return std::nullopt;
    rest.remove_prefix(1);
  }
  const auto time = take_time(rest, !days);
  if (!time) return std::nullopt;
  const auto zone = take_zone(rest);
  if (!zone || !rest.empty()) return std::nullopt;
  stamp.ns += *time - *zone;
  return stamp;
}

}  // namespace invar::recording
