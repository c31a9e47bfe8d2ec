// A path that a command brings: what is opened, and that nobody learns what else is there.
#include "core/component/cell_folders.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "core/base/temporary_folder.hpp"

namespace invar {
namespace {

namespace fs = std::filesystem;

class Folders : public ::testing::Test {
 protected:
  Folders() {
    fs::create_directories(folder / "cell/sub");
    fs::create_directories(folder / "cell-other");
    write("cell/model.yaml", "# a model\ninvar_model: 1\nplant: axis\n");
    write("cell/sub/map.yaml", "invar_compensation: 1\n");
    write("cell/secret.yaml", "password: x\n");
    write("cell/key.pem", "invar_model: 1\n");
    write("cell-other/model.yaml", "invar_model: 1\n");
    write("outside.yaml", "invar_model: 1\n");
  }
  void write(const std::string& name, const std::string& text) { std::ofstream{folder / name} << text; }
  [[nodiscard]] bool found(const fs::path& name) const { return folders.model(folder / name).has_value(); }

  TemporaryFolder folder{"invar-test"};
  CellFolders folders{{folder / "cell"}, {folder / "out"}};
};

TEST_F(Folders, AModelIsReadFromThePlacesOfTheCellAndFromNoOther) {
  EXPECT_TRUE(found("cell/model.yaml"));
  EXPECT_TRUE(found("cell/sub/map.yaml"));
  EXPECT_TRUE(found("cell/sub/../model.yaml"));
  EXPECT_FALSE(found("outside.yaml"));
  EXPECT_FALSE(found("cell/../outside.yaml"));
  EXPECT_FALSE(found("cell-other/model.yaml")) << "a folder whose name only begins alike";
  EXPECT_FALSE(found("cell/nowhere.yaml"));
  EXPECT_FALSE(found("cell/secret.yaml")) << "no model";
  EXPECT_FALSE(found("cell/key.pem"));
  EXPECT_FALSE(found("cell"));
  EXPECT_FALSE(folders.model("/etc/passwd"));
  EXPECT_FALSE(folders.model(""));
}

TEST_F(Folders, ALinkLeadsNowhereElse) {
  fs::create_symlink(folder / "outside.yaml", folder / "cell/link.yaml");
  fs::create_directory_symlink(folder / "cell-other", folder / "cell/linked");
  fs::create_symlink(folder / "cell/model.yaml", folder / "cell/own.yaml");
  EXPECT_FALSE(found("cell/link.yaml"));
  EXPECT_FALSE(found("cell/linked/model.yaml"));
  EXPECT_TRUE(found("cell/own.yaml"));
}

TEST_F(Folders, WhatHasNoEndIsNotOpened) {
  ASSERT_EQ(mkfifo((folder / "cell/pipe.yaml").c_str(), 0600), 0);
  EXPECT_FALSE(found("cell/pipe.yaml")) << "nor waited for";
  fs::create_symlink("/dev/zero", folder / "cell/zero.yaml");
  EXPECT_FALSE(found("cell/zero.yaml"));
}

TEST_F(Folders, AFolderMayBeMadeLater) {
  const CellFolders later{{folder / "later"}, {}};
  EXPECT_FALSE(later.model(folder / "later/model.yaml"));
  fs::create_directories(folder / "later");
  write("later/model.yaml", "invar_model: 1\n");
  EXPECT_TRUE(later.model(folder / "later/model.yaml"));
}

TEST_F(Folders, APictureIsWrittenAmongTheResultsOnly) {
  EXPECT_TRUE(folders.picture(folder / "out/run/a.png")) << "the folder is made with it";
  EXPECT_FALSE(folders.picture(folder / "out/run/a.yaml"));
  EXPECT_FALSE(folders.picture(folder / "out/../cell/a.png"));
  EXPECT_FALSE(folders.picture(folder / "cell/a.png"));
  fs::create_directories(folder / "out");
  fs::create_symlink(folder / "outside.yaml", folder / "out/link.png");
  EXPECT_FALSE(folders.picture(folder / "out/link.png"));
}

}  // namespace
}  // namespace invar
