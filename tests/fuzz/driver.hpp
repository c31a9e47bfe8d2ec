// Runs readers on changed inputs, in child processes: one that crashes, hangs or takes too much memory is told, with its input.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/fuzz/mutate.hpp"

namespace invar::fuzz {

struct Target {
  std::string name;
  std::string ending;  // of the file that holds the input, with its dot
  std::vector<Bytes> seeds;
  std::vector<std::string> words;  // of the format
  /// Reads the input, which is in `file` too where `ending` is not empty. Refuses by InputError, in one line that names the
  /// file; any other exception is a failure, and so is std::bad_alloc.
  std::function<void(const Bytes& input, const std::filesystem::path& file)> read;
};

struct Plan {
  std::uint64_t seed = 1;
  std::uint64_t runs = 1000;           // of each target
  double seconds = 0.0;                // of each target at most; 0: all runs
  std::uint64_t memory = 1ULL << 30U;  // [bytes] beyond what a child has when it begins
  double hang = 20.0;                  // [s] that one input may take
  std::filesystem::path keep = "fuzz-failures";
};

struct Result {
  std::string target;
  std::uint64_t runs = 0, refused = 0;
  double slowest = 0.0;      // [s]
  std::uint64_t memory = 0;  // [bytes] most that a child grew by
  std::vector<std::string> failures;
};

/// Input `number` of the target, as `run` made it.
Bytes input_of(const Target& target, std::uint64_t seed, std::uint64_t number);

Result run(const Target& target, const Plan& plan);

/// Reads one input in this process, for a debugger; prints what comes of it.
void replay(const Target& target, const Bytes& input);

}  // namespace invar::fuzz
