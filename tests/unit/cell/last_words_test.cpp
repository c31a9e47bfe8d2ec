#include "tools/cell/last_words.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "core/base/temporary_folder.hpp"

namespace invar::tools {
namespace {

TEST(LastWords, AreThereAsAWholeAndWhereTheirFolderIsGoneTheCellGoesOn) {
  const TemporaryFolder folder{"invar-words"};
  const auto outcome = folder / "cell" / "motion.json";
  ProgressFile nowhere{outcome};
  EXPECT_NO_THROW(nowhere.leave(0.5, "measures"));
  EXPECT_NO_THROW(write_whole(outcome, {{"process", "motion"}}));
  std::filesystem::create_directory(outcome.parent_path());
  ProgressFile progress{outcome};
  progress.leave(0.5, "measures");
  const auto left = nlohmann::json::parse(std::ifstream{progress_file(outcome)});
  EXPECT_EQ(left, (nlohmann::json{{"fraction", 0.5}, {"text", "measures"}}));
}

// A disk that takes no more takes half a file.
TEST(LastWords, AreNotThereWhereTheDiskIsFull) {
  const TemporaryFolder folder{"invar-words"};
  const auto outcome = folder / "motion.json";
  std::filesystem::path part = outcome;
  std::filesystem::create_symlink("/dev/full", part += ".part");
  write_whole(outcome, {{"process", "motion"}});
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(outcome)));
}

}  // namespace
}  // namespace invar::tools
