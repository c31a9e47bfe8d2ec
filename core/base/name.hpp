// Names and texts from outside: which characters they may have, how long they may be, and how any text is shown.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace invar {

/// An identifier stands in topics, file names, formulas and bounded strings on the wire.
constexpr std::size_t longest_identifier = 31;
/// A title, a column header, a line's name: what stands in a table cell or a plot's key and is still read.
constexpr std::size_t longest_label = 200;
/// A topic in a foreign recording; DDS has no bound.
constexpr std::size_t longest_topic = 1024;

/// The flaw of a name: "has the control character 0x1B at byte 3".
struct NameFlaw {
  std::string what;
  std::string mend;
};

/// An identifier has 1 to 31 letters, digits and `_` (with `also`, these characters too).
std::optional<NameFlaw> flaw_of_identifier(std::string_view name, std::string_view also = "");

/// A text is UTF-8 without control characters (C0 but for line feed and tab, DEL, C1, and what turns the direction of writing).
std::optional<NameFlaw> flaw_of_text(std::string_view text);

/// A label is a text of one line; the units' letters (the degree and micro signs, omega) are in it.
std::optional<NameFlaw> flaw_of_label(std::string_view label, std::size_t most = longest_label);

/// Any bytes as one printable line: what is no text becomes `\x1b`. Nothing that a terminal would act upon is left.
std::string printable(std::string_view bytes);

/// The same for a text of several lines: line feeds and tabs stay.
std::string printable_lines(std::string_view bytes);

/// The same with the sign for an unknown character (U+FFFD), as a program that reads the text as JSON or XML takes it.
std::string letters_of(std::string_view bytes);

}  // namespace invar
