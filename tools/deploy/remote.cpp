#include "tools/deploy/remote.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "core/base/contract.hpp"

extern char** environ;  // NOLINT: POSIX names it so

namespace invar::tools {

namespace {

struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      throw std::runtime_error{std::string{"no pipe: "} + std::strerror(errno)};
    read = ends[0];
    write = ends[1];
  }
};

/// All of it, to its end; `mark` gets a byte at the first line end.
void read_all(int from, std::string& text, int mark) {
  std::array<char, 4096> part{};
  for (ssize_t size = 0; (size = read(from, part.data(), part.size())) > 0 || (size < 0 && errno == EINTR);) {
    if (size < 0) continue;
    text.append(part.data(), static_cast<std::size_t>(size));
    if (mark >= 0 && text.find('\n') != std::string::npos) {
      (void)!::write(mark, "\n", 1);
      close(mark);
      mark = -1;
    }
  }
  if (mark >= 0) close(mark);
  close(from);
}

pid_t start(std::vector<std::string>& words, int in, int out, int err) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  sigset_t pipes;
  sigemptyset(&pipes);
  sigaddset(&pipes, SIGPIPE);
  posix_spawnattr_setsigdefault(&attributes, &pipes);
  pid_t child = -1;
  const int error = posix_spawnp(&child, words[0].c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  for (const int end : {in, out, err}) close(end);
  if (error == ENOENT) throw std::runtime_error{"`ssh` is not there; install openssh-client"};
  if (error != 0) throw std::runtime_error{std::string{"`ssh` cannot be started: "} + std::strerror(error)};
  return child;
}

}  // namespace

std::string remote_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string{c};
  return word + "'";
}

std::vector<std::string> ssh_words(const RemoteHost& host, const std::string& script,
                                   const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"ssh", "-T"};
  // Nobody is there to answer questions, and a host that went is noticed.
  for (const char* option : {"BatchMode=yes", "ConnectTimeout=10", "ServerAliveInterval=5",
                             "ServerAliveCountMax=3", "ForwardX11=no"})
    words.insert(words.end(), {"-o", option});
  if (!host.config.empty()) words.insert(words.end(), {"-F", host.config.string()});
  if (!host.identity.empty()) words.insert(words.end(), {"-i", host.identity.string()});
  if (host.port != 0) words.insert(words.end(), {"-p", std::to_string(host.port)});
  if (!host.user.empty()) words.insert(words.end(), {"-l", host.user});
  std::string line = "exec sh -c " + remote_word(script) + " invar-deploy";
  for (const std::string& argument : arguments) line += ' ' + remote_word(argument);
  words.insert(words.end(), {"--", host.address, line});
  return words;
}

Remote::Remote(const RemoteHost& host, const std::string& script, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = ssh_words(host, script, arguments);
  Pipe in, out, err, line;
  pid_ = start(words, in.read, out.write, err.write);
  input_ = in.write;
  line_ = line.read;
  out_ = std::thread{[this, from = out.read, mark = line.write] { read_all(from, said_.out, mark); }};
  err_ = std::thread{[this, from = err.read] { read_all(from, said_.err, -1); }};
}

Remote::~Remote() {
  if (pid_ > 0) (void)finish();
}

bool Remote::write(const char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(input_, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

bool Remote::wait_for_line() {
  char mark = 0;
  ssize_t size = 0;
  while ((size = read(line_, &mark, 1)) < 0 && errno == EINTR) {
  }
  return size == 1;
}

void Remote::close_input() {
  if (input_ >= 0) close(input_);
  input_ = -1;
}

Said Remote::finish() {
  close_input();
  out_.join();
  err_.join();
  close(line_);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  said_.status = WIFEXITED(status) ? WEXITSTATUS(status) : 255;
  return said_;
}

Said call(const RemoteHost& host, const std::string& script, const std::vector<std::string>& arguments,
          const std::string& input) {
  Remote remote{host, script, arguments};
  (void)remote.write(input);
  return remote.finish();
}

std::string tar_head(const std::string& name, std::uintmax_t size) {
  INVAR_EXPECTS(name.size() < 100);
  std::string head(512, '\0');
  const auto put = [&](std::size_t at, const std::string& text) { head.replace(at, text.size(), text); };
  const auto octal = [](std::uintmax_t number, std::size_t digits) {
    std::string text(digits, '0');
    for (; digits > 0; number /= 8) text[--digits] = static_cast<char>('0' + number % 8);
    return text;
  };
  put(0, name);
  put(100, "0000644");
  put(108, "0000000");
  put(116, "0000000");
  put(124, octal(size, 11));
  put(136, octal(0, 11));
  put(148, "        ");
  put(156, "0");
  put(257, std::string{"ustar\00000", 8});
  unsigned sum = 0;
  for (const char c : head) sum += static_cast<unsigned char>(c);
  put(148, octal(sum, 6) + std::string{"\0 ", 2});
  return head;
}

std::string tar_padding(std::uintmax_t size) { return std::string((512 - size % 512) % 512, '\0'); }

std::string tar_end() { return std::string(1024, '\0'); }

}  // namespace invar::tools
