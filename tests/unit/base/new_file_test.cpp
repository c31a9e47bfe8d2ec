#include "core/base/new_file.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "core/base/temporary_folder.hpp"

namespace invar {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& file) {
  std::ifstream in{file};
  return {std::istreambuf_iterator<char>{in}, {}};
}

class NewFileTest : public ::testing::Test {
 protected:
  std::size_t entries() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator{folder.path()}, fs::directory_iterator{}));
  }
  TemporaryFolder folder{"new-file"};
};

TEST_F(NewFileTest, LeavesTheOldOneUntilItIsFinished) {
  write_file(folder / "a", "old");
  {
    NewFile file{folder / "a"};
    std::ofstream{file.path()} << "half";
    EXPECT_EQ(text_of(folder / "a"), "old");
  }
  EXPECT_EQ(text_of(folder / "a"), "old");
  EXPECT_EQ(entries(), 1U);
  write_file(folder / "a", "new");
  EXPECT_EQ(text_of(folder / "a"), "new");
  EXPECT_EQ(entries(), 1U);
}

TEST_F(NewFileTest, RefusesAFolderAndAMissingOne) {
  fs::create_directory(folder / "sub");
  EXPECT_THROW(write_file(folder / "sub", "x"), InputError);
  EXPECT_THROW(write_file(folder / "nowhere/a", "x"), InputError);
  EXPECT_EQ(entries(), 1U);
}

TEST_F(NewFileTest, FollowsALink) {
  fs::create_symlink("there", folder / "link");
  for (const auto* text : {"first", "second"}) {
    write_file(folder / "link", text);
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_EQ(text_of(folder / "there"), text);
  }
}

// `--output /dev/stdout` once took the device's place.
TEST_F(NewFileTest, WritesIntoAPipeAndLeavesItThere) {
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  std::string read;
  std::thread reader{[&] { read = text_of(folder / "pipe"); }};
  write_file(folder / "pipe", "through");
  reader.join();
  EXPECT_EQ(read, "through");
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_EQ(entries(), 1U);
}

}  // namespace
}  // namespace invar
