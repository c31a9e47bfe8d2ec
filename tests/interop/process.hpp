// A child process whose output is read.
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <vector>

namespace invar::testing {

class Child {
 public:
  /// `environment` is added to ours, as "NAME=value".
  Child(std::vector<std::string> words, const std::vector<std::string>& environment = {}) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) return;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    std::vector<std::string> all = environment;
    for (char** entry = environ; *entry != nullptr; ++entry) all.emplace_back(*entry);
    std::vector<char*> entries;
    for (auto& entry : all) entries.push_back(entry.data());
    entries.push_back(nullptr);
    posix_spawnp(&pid_, words.front().c_str(), &actions, nullptr, arguments.data(), entries.data());
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    output_ = ends[0];
    fcntl(output_, F_SETFL, O_NONBLOCK);
  }
  ~Child() {
    if (pid_ > 0 && !has_ended()) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    if (output_ >= 0) close(output_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// All that it wrote so far.
  const std::string& output() {
    char buffer[4096];
    for (ssize_t n = 0; (n = read(output_, buffer, sizeof buffer)) > 0;)
      text_.append(buffer, static_cast<std::size_t>(n));
    return text_;
  }
  bool has_ended() {
    if (!ended_ && pid_ > 0) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
    return ended_;
  }
  /// Exit status; valid when it has ended.
  [[nodiscard]] int status() const {
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  }
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  int output_ = -1;
  int status_ = 0;
  bool ended_ = false;
  std::string text_;
};

}  // namespace invar::testing
