#include "tools/live/terminal.hpp"

#include "core/base/name.hpp"

namespace invar::tools {

LettersOnly::LettersOnly(std::ostream& stream) : stream_{stream}, below_{stream.rdbuf(this)} {}

LettersOnly::~LettersOnly() {
  (void)write_held(true);
  stream_.rdbuf(below_);
}

bool LettersOnly::write_held(bool all) {
  std::size_t whole = held_.size();
  // Of a letter of several bytes the first says how many; a beginning of at most three waits for the rest.
  for (std::size_t back = 1; !all && back <= 3 && back <= held_.size(); ++back) {
    const auto byte = static_cast<unsigned char>(held_[held_.size() - back]);
    if ((byte & 0xC0U) == 0x80U) continue;
    const std::size_t bytes = byte >= 0xF0U ? 4 : byte >= 0xE0U ? 3 : byte >= 0xC0U ? 2 : 1;
    if (bytes > back) whole = held_.size() - back;
    break;
  }
  const std::string text = letters_of(std::string_view{held_}.substr(0, whole));
  held_.erase(0, whole);
  return below_->sputn(text.data(), static_cast<std::streamsize>(text.size())) ==
         static_cast<std::streamsize>(text.size());
}

LettersOnly::int_type LettersOnly::overflow(int_type letter) {
  if (traits_type::eq_int_type(letter, traits_type::eof())) return traits_type::not_eof(letter);
  held_ += traits_type::to_char_type(letter);
  return write_held(false) ? letter : traits_type::eof();
}

std::streamsize LettersOnly::xsputn(const char* text, std::streamsize count) {
  held_.append(text, static_cast<std::size_t>(count));
  return write_held(false) ? count : 0;
}

int LettersOnly::sync() { return write_held(true) ? below_->pubsync() : -1; }

void steer(std::ostream& stream, std::string_view order) {
  auto* filter = dynamic_cast<LettersOnly*>(stream.rdbuf());
  if (filter != nullptr) (void)filter->write_held(true);
  auto* target = filter != nullptr ? filter->below_ : stream.rdbuf();
  (void)target->sputn(order.data(), static_cast<std::streamsize>(order.size()));
}

}  // namespace invar::tools
