// Times as loggers write them: 2024-03-01T09:00:02.400, 2024/03/01-09:00:02, 01.03.2024 09:00, 09:00:02.4.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace invar::recording {

struct TimeStamp {
  std::int64_t ns =
      0;  // since 1970 in the stamp's own zone made UTC; of a time without a date since midnight
  bool has_date = true;             // false: hours, minutes and seconds alone
  std::string_view ambiguous = {};  // the date, where day and month may be either way round (03/04/2024)
};

/// The stamp that a cell is; nothing where it is none. The year stands first, or last with dots and then the day comes
/// first (DIN 5008); with slashes or dashes and the year last nobody knows, unless one number is beyond 12.
std::optional<TimeStamp> parse_time_stamp(std::string_view cell);

}  // namespace invar::recording
