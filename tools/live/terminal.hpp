// Output to a terminal: texts as letters only, and the few orders that are the program's own.
#pragma once

#include <ostream>
#include <streambuf>
#include <string>
#include <string_view>

namespace invar::tools {

/// While this object lives, nothing that goes into `stream` steers the terminal. A control character in the name of a file, a
/// topic or a device comes out as the sign for an unknown character. Line feeds and tabs stay.
class LettersOnly final : public std::streambuf {
 public:
  explicit LettersOnly(std::ostream& stream);
  ~LettersOnly() override;
  LettersOnly(const LettersOnly&) = delete;
  LettersOnly& operator=(const LettersOnly&) = delete;

 private:
  friend void steer(std::ostream& stream, std::string_view order);
  int_type overflow(int_type letter) override;
  std::streamsize xsputn(const char* text, std::streamsize count) override;
  int sync() override;
  bool write_held(bool all);

  std::ostream& stream_;
  std::streambuf* below_;
  std::string held_;  // the beginning of a letter whose other bytes come with the next text
};

constexpr std::string_view clear_line = "\r\x1b[K", clear_to_line_end = "\x1b[K", clear_below = "\x1b[J",
                           go_home = "\x1b[H", red = "\x1b[31m", plain = "\x1b[0m";

/// An order of the program's own to the terminal behind `stream`, past the filter.
void steer(std::ostream& stream, std::string_view order);

}  // namespace invar::tools
