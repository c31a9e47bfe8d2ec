#include "core/base/name.hpp"

#include <cstdint>

namespace invar {

namespace {

/// One character of UTF-8; `bytes` of 1 and no `code` where the bytes are none.
struct Character {
  std::size_t bytes = 1;
  std::optional<std::uint32_t> code;
};

Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = byte(0);
  if (lead < 0x80U) return {1, lead};
  const std::size_t length = lead >= 0xF0U ? 4 : lead >= 0xE0U ? 3 : 2;
  if (lead < 0xC2U || lead > 0xF4U || text.size() < length) return {};
  std::uint32_t code = lead & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800U && code <= 0xDFFFU;
  if (code < least[length] || surrogate || code > 0x10FFFFU) return {};
  return {length, code};
}

/// Does it steer whoever shows it: a terminal, or the order of the letters of a line?
bool steers(std::uint32_t code) {
  const bool control = code < 0x20U || (code >= 0x7FU && code < 0xA0U);
  const bool line_end = code == 0x2028U || code == 0x2029U;
  const bool direction = code == 0x200EU || code == 0x200FU || code == 0x061CU ||
                         (code >= 0x202AU && code <= 0x202EU) || (code >= 0x2066U && code <= 0x2069U);
  return control || line_end || direction || code == 0xFEFFU;
}

std::string hexadecimal(std::uint32_t value, int digits) {
  std::string text;
  for (int shift = 4 * (digits - 1); shift >= 0; shift -= 4)
    text += "0123456789abcdef"[value >> static_cast<unsigned>(shift) & 0xFU];
  return text;
}

bool is_layout(std::uint32_t code) { return code == '\n' || code == '\t'; }

std::optional<NameFlaw> flaw(std::string_view text, bool layout) {
  for (std::size_t at = 0; at < text.size();) {
    const Character next = first_character(text.substr(at));
    const std::string where = " at byte " + std::to_string(at + 1);
    if (!next.code)
      return NameFlaw{"has a byte 0x" + hexadecimal(static_cast<unsigned char>(text[at]), 2) +
                          " that is no UTF-8" + where,
                      "write it in UTF-8"};
    if (steers(*next.code) && !(layout && is_layout(*next.code)))
      return NameFlaw{"has the control character U+" + hexadecimal(*next.code, 4) + where,
                      "leave it out: letters, digits, signs and spaces will do"};
    at += next.bytes;
  }
  return std::nullopt;
}

enum class Unknown { hexadecimal, sign };
std::string shown(std::string_view bytes, bool layout, Unknown unknown = Unknown::hexadecimal) {
  std::string text;
  text.reserve(bytes.size());
  for (std::size_t at = 0; at < bytes.size();) {
    const Character next = first_character(bytes.substr(at));
    const std::string_view whole = bytes.substr(at, next.bytes);
    const bool good = next.code && (!steers(*next.code) || (layout && is_layout(*next.code)));
    if (good)
      text += whole;
    else if (unknown == Unknown::sign)
      text += "\xEF\xBF\xBD";
    else
      for (const char byte : whole) text += "\\x" + hexadecimal(static_cast<unsigned char>(byte), 2);
    at += next.bytes;
  }
  return text;
}

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

std::optional<NameFlaw> flaw_of_identifier(std::string_view name, std::string_view also) {
  std::string mend = "use 1 to " + std::to_string(longest_identifier) + " letters, digits";
  for (const char c : also) mend += std::string{", "} + c;
  mend += " or _";
  if (name.empty()) return NameFlaw{"is empty", mend};
  if (name.size() > longest_identifier)
    return NameFlaw{"has " + std::to_string(name.size()) + " characters", mend};
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (is_letter_or_digit(c) || c == '_' || also.find(c) != std::string_view::npos) continue;
    const auto next = first_character(name.substr(i));
    return NameFlaw{"has `" + printable(name.substr(i, next.bytes)) + "` at byte " + std::to_string(i + 1),
                    mend};
  }
  return std::nullopt;
}

std::optional<NameFlaw> flaw_of_text(std::string_view text) { return flaw(text, true); }

std::optional<NameFlaw> flaw_of_label(std::string_view label, std::size_t most) {
  if (label.size() > most)
    return NameFlaw{"has " + std::to_string(label.size()) + " bytes", "use at most " + std::to_string(most)};
  return flaw(label, false);
}

std::string printable(std::string_view bytes) { return shown(bytes, false); }
std::string printable_lines(std::string_view bytes) { return shown(bytes, true); }

std::string letters_of(std::string_view bytes) { return shown(bytes, true, Unknown::sign); }

}  // namespace invar
