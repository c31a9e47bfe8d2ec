// Remote: a fixed script run on another PC by ssh.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/config/cell.hpp"

namespace invar::tools {

/// How to call a host: what `ssh` takes.
struct RemoteHost {
  std::string name;                        // in the cell file
  std::string address;                     // IPv4 or a name
  int port = 0;                            // 0: what ssh takes
  std::string user;                        // empty: what ssh takes
  std::filesystem::path identity, config;  // empty: those of the user
};

struct Said {
  int status = 0;  // of the script; 255: ssh could not reach the host
  std::string out, err;
};

/// A word as any shell of the other PC takes it: between single quotes, so nothing in it is more than a letter.
[[nodiscard]] std::string remote_word(const std::string& text);

/// The words of the call: `ssh`, its options, the host, and one line for the shell there. All in that line but fixed text goes
/// by remote_word.
[[nodiscard]] std::vector<std::string> ssh_words(const RemoteHost& host, const std::string& script,
                                                 const std::vector<std::string>& arguments);

/// One call. The script reads what is written here as its standard input. Not copied; one thread.
class Remote {
 public:
  /// Throws std::runtime_error where `ssh` cannot be started.
  Remote(const RemoteHost& host, const std::string& script, const std::vector<std::string>& arguments);
  ~Remote();
  Remote(const Remote&) = delete;
  Remote& operator=(const Remote&) = delete;

  /// False: nobody reads any more; finish() says why.
  bool write(const char* bytes, std::size_t size);
  bool write(const std::string& text) { return write(text.data(), text.size()); }
  /// Waits until the script has written a line to its standard output. False: it ended without.
  [[nodiscard]] bool wait_for_line();
  /// Ends its input and waits for its end.
  [[nodiscard]] Said finish();

 private:
  void close_input();
  pid_t pid_ = -1;
  int input_ = -1, line_ = -1;
  Said said_;
  std::thread out_, err_;
};

/// The whole of a call whose input is a text.
[[nodiscard]] Said call(const RemoteHost& host, const std::string& script,
                        const std::vector<std::string>& arguments, const std::string& input = "");

/// The head of a file in a tar archive (ustar), and the end of an archive.
[[nodiscard]] std::string tar_head(const std::string& name, std::uintmax_t size);
[[nodiscard]] std::string tar_padding(std::uintmax_t size);
[[nodiscard]] std::string tar_end();

}  // namespace invar::tools
