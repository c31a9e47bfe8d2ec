#include "core/base/input_file.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <future>
#include <thread>

#include "core/base/fault.hpp"
#include "core/base/temporary_folder.hpp"

namespace invar {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

class InputFile : public ::testing::Test {
 protected:
  static std::string read_all(const std::filesystem::path& file) {
    const int opened = open_input(file, "a text file");
    std::string text;
    std::array<char, 64> block{};
    for (ssize_t got = 0; (got = read(opened, block.data(), block.size())) > 0;)
      text.append(block.data(), static_cast<std::size_t>(got));
    close(opened);
    return text;
  }
  static std::string fault_of(const std::filesystem::path& file) {
    try {
      close(open_input(file, "a text file"));
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }
  std::filesystem::path make_pipe(const char* name) {
    const auto pipe = folder.path() / name;
    EXPECT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    return pipe;
  }
  TemporaryFolder folder{"input"};
};

TEST_F(InputFile, IsReadFromAPipeThatSomebodyFillsLater) {
  const auto pipe = make_pipe("pipe");
  std::thread writer{[&] {
    std::ofstream into{pipe};
    std::this_thread::sleep_for(600ms);
    into << "mass: 3\n";
  }};
  EXPECT_EQ(read_all(pipe), "mass: 3\n");
  writer.join();
}

TEST_F(InputFile, IsNotWaitedForWhereNobodyWrites) {
  const auto pipe = make_pipe("pipe");
  auto said = std::async(std::launch::async, [&] { return fault_of(pipe); });
  if (said.wait_for(60s) != std::future_status::ready) {
    std::ofstream{pipe} << '\n';  // ends the wait
    FAIL() << "waits without end";
  }
  EXPECT_THAT(said.get(), HasSubstr("pipe: is a pipe into which nobody has written; name a text file"));
}

TEST_F(InputFile, IsNoFolderAndNoDeviceWhichHasNoEnd) {
  EXPECT_THAT(fault_of(folder.path()), HasSubstr("is a folder; name a text file"));
  EXPECT_THAT(fault_of("/dev/zero"), HasSubstr("is a device and no file; name a text file"));
  EXPECT_THAT(fault_of(folder.path() / "none"), HasSubstr("cannot be read; check the path"));
}

}  // namespace
}  // namespace invar
