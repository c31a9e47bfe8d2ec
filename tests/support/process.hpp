// A child process with pipes to its stdin and from its stdout, for tests against foreign programs.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace invar::test {

class Process {
 public:
  explicit Process(std::vector<std::string> command) {
    std::array<int, 2> in{};
    std::array<int, 2> out{};
    if (pipe2(in.data(), O_CLOEXEC) != 0 || pipe2(out.data(), O_CLOEXEC) != 0)
      throw std::runtime_error{"pipe"};
    std::vector<char*> words;
    for (auto& word : command) words.push_back(word.data());
    words.push_back(nullptr);
    pid_ = fork();
    if (pid_ < 0) throw std::runtime_error{"fork"};
    if (pid_ == 0) {
      dup2(in[0], 0);
      dup2(out[1], 1);
      execvp(words[0], words.data());
      _exit(127);
    }
    close(in[0]);
    close(out[1]);
    to_ = in[1];
    from_ = out[0];
  }
  ~Process() { kill(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void send(const std::string& line) const {
    const std::string text = line + "\n";
    if (write(to_, text.data(), text.size()) < 0) throw std::runtime_error{"the process does not listen"};
  }
  /// The next line of its output; throws when it ends or says nothing for a minute.
  std::string line() {
    for (;;) {
      if (const auto end = buffer_.find('\n'); end != std::string::npos) {
        std::string result = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        return result;
      }
      if (!read_some()) throw std::runtime_error{"the process ended or hangs; it said: " + buffer_};
    }
  }
  /// All that is left of its output, once it ended by itself.
  std::string rest() {
    while (read_some()) {
    }
    return std::move(buffer_);
  }
  void kill() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    close(to_);
    close(from_);
    pid_ = 0;
  }

 private:
  bool read_some() {
    pollfd readable{from_, POLLIN, 0};
    if (poll(&readable, 1, 60'000) <= 0) return false;
    std::array<char, 4096> bytes;
    const ssize_t size = read(from_, bytes.data(), bytes.size());
    if (size > 0) buffer_.append(bytes.data(), static_cast<std::size_t>(size));
    return size > 0;
  }

  pid_t pid_ = 0;
  int to_ = -1;
  int from_ = -1;
  std::string buffer_;
};

}  // namespace invar::test
