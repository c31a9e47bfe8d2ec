// The lines of a text file, plain or gzip, unpacked block by block: an hour at 1 kHz is hundreds of megabytes of text.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace invar::recording {

class TextLines {
 public:
  /// Throws InputError where the file cannot be read, is damaged or is no text.
  explicit TextLines(const std::filesystem::path& file);

  /// The next line without its end, good until the next call; false where there are no more. Throws as above.
  bool next(std::string_view& line);
  /// Throws where the rest of the file is damaged: that is what is wrong with it then, whatever a line seems to lack.
  void check_rest();

 private:
  void more();
  void check_size() const;

  std::string file_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> stream_{nullptr, gzclose};
  std::string text_;  // from the line at `at_` to the end of the last block
  std::size_t at_ = 0, lines_ = 0;
  std::uint64_t unpacked_ = 0;
  bool ended_ = false;
};

}  // namespace invar::recording
