#include "tests/fuzz/driver.hpp"

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iostream>
#include <new>

#include "core/base/fault.hpp"
#include "core/base/name.hpp"
#include "core/base/temporary_folder.hpp"

namespace invar::fuzz {

namespace {

using Clock = std::chrono::steady_clock;

/// What a child tells while it runs; it lives in memory that both share.
struct Shared {
  std::atomic<std::uint64_t> number{0};  // of the input that is read now
  std::atomic<std::uint64_t> done{0}, refused{0}, grown{0};
  std::atomic<std::uint64_t> slowest_ns{0};
  char failure[512] = {};
};

std::uint64_t hash(const std::string& text) {
  std::uint64_t value = 14695981039346656037U;
  for (const char c : text) value = (value ^ static_cast<unsigned char>(c)) * 1099511628211U;
  return value;
}

void bound_address_space([[maybe_unused]] std::uint64_t more) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadow takes terabytes
  std::ifstream statm{"/proc/self/statm"};
  std::uint64_t pages = 0;
  statm >> pages;
  const std::uint64_t most = pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) + more;
  const rlimit space{most, most};
  setrlimit(RLIMIT_AS, &space);
#endif
}

std::uint64_t most_resident() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// What is wrong with the way in which the input was refused; empty where nothing is.
std::string wrong_refusal(const InputError& error, const Target& target, const std::filesystem::path& file) {
  const std::string line = error.what();
  if (flaw_of_text(line) || line.find('\n') != std::string::npos)
    return "the message is not one printable line";
  if (line.size() > 4096) return "the message has " + std::to_string(line.size()) + " bytes";
  if (error.faults().size() > 1000) return "there are " + std::to_string(error.faults().size()) + " faults";
  if (!target.ending.empty() && line.find(file.filename().string()) == std::string::npos)
    return "the message does not name the file: " + line;
  return "";
}

void write(const std::filesystem::path& file, const Bytes& bytes) {
  std::ofstream{file, std::ios::binary}.write(reinterpret_cast<const char*>(bytes.data()),
                                              static_cast<std::streamsize>(bytes.size()));
}

/// One input. What is wrong with it; empty where nothing is.
std::string one(const Target& target, const Bytes& input, const std::filesystem::path& file, Shared& shared) {
  if (!target.ending.empty()) write(file, input);
  try {
    target.read(input, file);
  } catch (const InputError& error) {
    ++shared.refused;
    return wrong_refusal(error, target, file);
  } catch (const std::bad_alloc&) {
    return "it takes more memory than the bound";
  } catch (const std::exception& error) {
    return std::string{"exception: "} + error.what();
  }
  return "";
}

[[noreturn]] void child(const Target& target, const Plan& plan, Shared& shared, std::uint64_t from,
                        Clock::time_point end) {
  bound_address_space(plan.memory);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  const TemporaryFolder folder{"invar-fuzz"};
  const auto file = folder / ("input" + target.ending);
  const std::uint64_t before = most_resident();
  const Mutator mutator{target.words};
  for (std::uint64_t number = from; number < plan.runs; ++number) {
    if (plan.seconds > 0.0 && Clock::now() > end) break;
    shared.number = number;
    const auto begin = Clock::now();
    const auto wrong =
        one(target, mutator.input(target.seeds, plan.seed ^ hash(target.name), number), file, shared);
    const auto took = static_cast<std::uint64_t>((Clock::now() - begin).count());
    shared.slowest_ns = std::max<std::uint64_t>(shared.slowest_ns, took);
    shared.grown = std::max<std::uint64_t>(shared.grown, most_resident() - before);
    ++shared.done;
    if (wrong.empty()) continue;
    std::strncpy(shared.failure, wrong.c_str(), sizeof shared.failure - 1);
    std::filesystem::remove_all(folder.path());
    _exit(3);
  }
  std::filesystem::remove_all(folder.path());
  _exit(0);
}

/// Waits for the child; how it ended, empty where well.
std::string ending_of(pid_t pid, const Shared& shared, double hang) {
  std::uint64_t seen = shared.done;
  auto since = Clock::now();
  for (;;) {
    int status = 0;
    if (waitpid(pid, &status, WNOHANG) == pid) {
      if (WIFSIGNALED(status)) return std::string{"signal "} + strsignal(WTERMSIG(status));
      if (WEXITSTATUS(status) == 0) return "";
      return shared.failure[0] != 0 ? shared.failure
                                    : "it ends with status " + std::to_string(WEXITSTATUS(status));
    }
    if (shared.done != seen) seen = shared.done, since = Clock::now();
    if (Clock::now() - since > std::chrono::duration<double>(hang)) {
      kill(pid, SIGKILL);
      waitpid(pid, &status, 0);
      return "it takes longer than " + std::to_string(static_cast<int>(hang)) + " s";
    }
    usleep(5000);
  }
}

}  // namespace

Bytes input_of(const Target& target, std::uint64_t seed, std::uint64_t number) {
  return Mutator{target.words}.input(target.seeds, seed ^ hash(target.name), number);
}

Result run(const Target& target, const Plan& plan) {
  constexpr std::size_t most_failures = 20;
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  auto& shared = *new (memory) Shared;
  Result result{target.name, 0, 0, 0.0, 0, {}};
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(plan.seconds));
  std::uint64_t next = 0;
  while (next < plan.runs && result.failures.size() < most_failures) {
    shared.failure[0] = 0;
    const pid_t pid = fork();
    if (pid == 0) child(target, plan, shared, next, end);
    const std::string wrong = ending_of(pid, shared, plan.hang);
    if (wrong.empty()) break;
    const std::uint64_t number = shared.number;
    std::filesystem::create_directories(plan.keep);
    const auto kept = plan.keep / (target.name + "-" + std::to_string(number) + target.ending);
    write(kept, input_of(target, plan.seed, number));
    result.failures.push_back(target.name + " " + std::to_string(number) + ": " + wrong + " (" +
                              kept.string() + ")");
    if (shared.done <= number) shared.done = number + 1;
    next = number + 1;
  }
  result.runs = shared.done;
  result.refused = shared.refused;
  result.memory = shared.grown;
  result.slowest = static_cast<double>(shared.slowest_ns) * 1e-9;
  munmap(memory, sizeof(Shared));
  return result;
}

void replay(const Target& target, const Bytes& input) {
  Shared shared;
  const TemporaryFolder folder{"invar-fuzz"};
  const auto file = folder / ("input" + target.ending);
  if (!target.ending.empty()) write(file, input);
  try {
    target.read(input, file);
    std::cout << "read\n";
  } catch (const InputError& error) {
    std::cout << error.what() << '\n';
  }
}

}  // namespace invar::fuzz
