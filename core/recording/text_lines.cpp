#include "core/recording/text_lines.hpp"

#include <algorithm>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/input_file.hpp"
#include "core/base/limits.hpp"

namespace invar::recording {

namespace {

constexpr std::size_t block = 1U << 18U;

}  // namespace

TextLines::TextLines(const std::filesystem::path& file) : file_{file.string()} {
  stream_.reset(gzdopen(open_input(file, "a CSV file"), "rb"));  // reads plain files too
  if (!stream_) throw InputError{file_, "cannot be read", "check the path and its permissions"};
  (void)gzbuffer(stream_.get(), 1U << 17U);
  more();
  if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
}

bool TextLines::next(std::string_view& line) {
  auto end = text_.find('\n', at_);
  while (end == std::string::npos && !ended_) {
    const std::size_t seen = text_.size() - at_;
    if (seen > limits::csv_line)
      throw InputError{file_ + ":" + std::to_string(lines_ + 1),
                       "a line has more than " + std::to_string(limits::csv_line / limits::mib) + " MiB",
                       "name a CSV file: a header, then one row a sample"};
    more();
    end = text_.find('\n', at_ + seen);
  }
  if (at_ >= text_.size()) return false;
  ++lines_;
  line = std::string_view{text_}.substr(at_, end == std::string::npos ? end : end - at_);
  at_ = end == std::string::npos ? text_.size() : end + 1;
  return true;
}

void TextLines::check_rest() {
  if (gzdirect(stream_.get()) != 0) return;  // not packed: nothing is damaged
  while (!ended_) at_ = text_.size(), more();
}

void TextLines::more() {
  text_.erase(0, std::exchange(at_, 0));
  const std::size_t kept = text_.size();
  text_.resize(kept + block);
  const int got = gzread(stream_.get(), text_.data() + kept, static_cast<unsigned>(block));
  if (got < 0) throw InputError{file_, "is damaged (gzip cannot unpack it)", "copy the file again"};
  text_.resize(kept + static_cast<std::size_t>(got));
  unpacked_ += static_cast<std::uint64_t>(got);
  check_size();
  if (text_.find('\0', kept) != std::string::npos)
    throw InputError{file_, "is not a text file", "name a CSV file"};
  if (got > 0) return;
  ended_ = true;
  int status = 0;
  gzerror(stream_.get(), &status);
  if (status == Z_BUF_ERROR) throw InputError{file_, "is cut off (gzip ends early)", "copy the file again"};
}

/// What is packed must not grow without end; numbers shrink to a third or a tenth.
void TextLines::check_size() const {
  const auto packed = static_cast<std::uint64_t>(std::max<z_off_t>(gzoffset(stream_.get()), 0));
  if (gzdirect(stream_.get()) != 0 ||
      unpacked_ <= limits::csv_unpacked_free + limits::csv_unpacked_times * packed)
    return;
  throw InputError{file_,
                   "unpacks to more than " + std::to_string(limits::csv_unpacked_times) + " times its size",
                   "see that it is the right file; if it is, unpack it by `gunzip` and name that"};
}

}  // namespace invar::recording
