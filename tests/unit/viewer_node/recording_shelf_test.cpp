// SPDX-License-Identifier: Apache-2.0
// What of a folder may be downloaded: recordings of this session, and nothing else.
#include "viewer_node/server/recording_shelf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/temp_folder.h"

namespace palpate::viewer {
namespace {

constexpr const char* kName = "lump-20261128-010203.mcap";

class Shelf : public testing::Test {
 protected:
  Shelf() {
    shelf_.set(true, "");
    files_.write(kName, "recorded");
  }
  [[nodiscard]] std::string content(const std::string& name) const {
    auto file = shelf_.open(name);
    if (!file) return "refused";
    std::array<char, 3> part{};
    std::string all;
    while (true) {
      const std::string_view bytes = file->read(part.data(), part.size());
      if (bytes.empty()) return all;
      all += bytes;
    }
  }

  test::TempFolder files_;
  RecordingShelf shelf_{(files_.path() / "").string(), "lump"};
};

TEST_F(Shelf, GivesARecordingOfTheSessionAndListsIt) {
  EXPECT_EQ(content(kName), "recorded");
  files_.write("lump-20261128-010204.mcap", "newer one");
  files_.write("other-20261128-010203.mcap", "of another session");
  files_.write("notes.txt", "private");
  const auto list = nlohmann::json::parse(shelf_.list_json());
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0]["name"], "lump-20261128-010204.mcap");
  EXPECT_EQ(list[1]["bytes"], 8);
  EXPECT_GT(list[1]["modified_s"], 1.6e9);
}

TEST_F(Shelf, OpensNothingElseWhateverTheNameIs) {
  files_.write("secret", "private");
  std::filesystem::create_directory(files_.path() / "lump-20261128-010205.mcap");
  std::filesystem::create_symlink(files_.path() / "secret",
                                  files_.path() / "lump-20261128-010206.mcap");
  ASSERT_EQ(mkfifo((files_.path() / "lump-20261128-010207.mcap").c_str(), 0600), 0);
  for (const std::string name :
       {"", ".", "..", "secret", "../secret", "lump-20261128-010203.mcap/../secret",
        "lump-20261128-010205.mcap", "lump-20261128-010206.mcap", "lump-20261128-010207.mcap",
        "lump-20261128-010203.mcap ", "lump-20261128-01020a.mcap", "lump-../../x-010203.mcap",
        "lump%2d20261128-010203.mcap", "LUMP-20261128-010203.mcap", "other-20261128-010203.mcap"}) {
    EXPECT_EQ(content(name), "refused") << name;
  }
  EXPECT_EQ(nlohmann::json::parse(shelf_.list_json()).size(), 1U);
}

TEST_F(Shelf, GivesNothingWhilePlacesAreHiddenNorWhatIsBeingWritten) {
  shelf_.set(false, "");
  EXPECT_EQ(content(kName), "refused");
  EXPECT_EQ(shelf_.list_json(), "[]\n");
  shelf_.set(true, kName);
  EXPECT_EQ(content(kName), "refused");
  EXPECT_EQ(shelf_.list_json(), "[]\n");
  EXPECT_FALSE(RecordingShelf("", "lump").open(kName));
}

TEST_F(Shelf, AFileThatGrowsIsReadToItsFormerEnd) {
  auto file = shelf_.open(kName);
  ASSERT_TRUE(file);
  files_.write(kName, "recorded, and then more");
  std::array<char, 64> part{};
  EXPECT_EQ(file->read(part.data(), part.size()), "recorded");
  EXPECT_EQ(file->left(), 0U);
  EXPECT_EQ(file->read(part.data(), part.size()), "");
}

}  // namespace
}  // namespace palpate::viewer
