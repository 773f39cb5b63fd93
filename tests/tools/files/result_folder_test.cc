#include "tools/files/result_folder.h"

#include <unistd.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using ::testing::HasSubstr;

void Write(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

std::ptrdiff_t NumEntries(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

// Writes results that consist of one file and one file in a subfolder.
void WriteResults(const fs::path& folder, const std::string& text) {
  StagedFolder staged(folder);
  Write(staged.staging() / "result.json", text);
  fs::create_directory(staged.staging() / "overlays");
  Write(staged.staging() / "overlays" / (text + ".jpg"), text);
  staged.Commit();
}

TEST(StagedFolderTest, AppearsOnCommitOnly) {
  const TempFolder folder;
  {
    StagedFolder staged(folder / "runs/a");
    Write(staged.staging() / "result.json", "1");
    EXPECT_FALSE(fs::exists(folder / "runs/a"));
    staged.Commit();
    EXPECT_TRUE(fs::exists(folder / "runs/a/result.json"));
  }
  EXPECT_TRUE(fs::exists(folder / "runs/a/result.json"));
  EXPECT_EQ(NumEntries(folder / "runs"), 1);
}

// Every new folder looks for stale ones next to it; a folder that another thread is creating is not stale.
TEST(StagedFolderTest, DoesNotRemoveStagingFoldersOfOtherThreads) {
  const TempFolder folder;
  constexpr int kNumThreads = 4;
  constexpr int kNumFolders = 200;
  std::vector<std::jthread> threads;
  std::atomic<int> num_lost = 0;
  for (int t = 0; t < kNumThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kNumFolders; ++i) {
        StagedFolder staged(folder / ("run" + std::to_string(t)));
        num_lost += fs::exists(staged.staging() / ".heba") ? 0 : 1;
      }
    });
  }
  threads.clear();
  EXPECT_EQ(num_lost, 0);
  EXPECT_EQ(NumEntries(folder.path()), 0);
}

TEST(StagedFolderTest, LeavesNothingWithoutCommit) {
  const TempFolder folder;
  Write(folder / "kept.txt", "x");
  {
    const StagedFolder staged(folder / "a");
    Write(staged.staging() / "result.json", "1");
  }
  EXPECT_EQ(NumEntries(folder.path()), 1);
}

TEST(StagedFolderTest, ReplacesItsOwnAndEmptyFolders) {
  const TempFolder folder;
  fs::create_directory(folder / "empty");
  WriteResults(folder / "older", "old");
  for (const char* name : {"empty", "older", "older/"}) {
    WriteResults(folder / name, "new");
    EXPECT_EQ(ReadTextFile(folder / name / "result.json"), "new");
    EXPECT_EQ(NumEntries(folder / name / "overlays"), 1) << "nothing is left of older results";
  }
  EXPECT_EQ(NumEntries(folder.path()), 2);
}

TEST(StagedFolderTest, KeepsFilesOfOthers) {
  const TempFolder folder;
  WriteResults(folder / "a", "old");
  Write(folder / "a/notes.txt", "mine");
  fs::create_directories(folder / "a/runs/first");
  Write(folder / "a/runs/first/result.json", "mine");
  Write(folder / "a/overlays/mine.jpg", "mine");
  fs::create_symlink("notes.txt", folder / "a/link");
  WriteResults(folder / "a", "new");
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "new");
  EXPECT_EQ(ReadTextFile(folder / "a/notes.txt"), "mine");
  EXPECT_EQ(ReadTextFile(folder / "a/runs/first/result.json"), "mine");
  EXPECT_EQ(ReadTextFile(folder / "a/overlays/mine.jpg"), "mine");
  EXPECT_TRUE(fs::is_symlink(folder / "a/link"));
  EXPECT_EQ(NumEntries(folder / "a/overlays"), 2);
  EXPECT_EQ(NumEntries(folder.path()), 1);
  // A second commit does not treat them as heba's files.
  WriteResults(folder / "a", "newer");
  EXPECT_EQ(ReadTextFile(folder / "a/notes.txt"), "mine");
}

TEST(StagedFolderTest, RefusesToReplaceEditedFiles) {
  const TempFolder folder;
  WriteResults(folder / "a", "old");
  Write(folder / "a/result.json", "edited");
  EXPECT_THAT(InputErrorOf([&] { StagedFolder(folder / "a"); }),
              HasSubstr("result.json: was changed since heba wrote it"));
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "edited");
  // A file that was deleted, or that a full disk left empty, is written again.
  Write(folder / "a/result.json", "");
  WriteResults(folder / "a", "newer");
  fs::remove(folder / "a/result.json");
  WriteResults(folder / "a", "new");
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "new");
  // The file is edited while the work is in progress.
  StagedFolder staged(folder / "a");
  Write(staged.staging() / "result.json", "newer");
  Write(folder / "a/result.json", "edited");
  EXPECT_THAT(InputErrorOf([&] { staged.Commit(); }), HasSubstr("was changed"));
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "edited");
}

// The results of a run do not replace the data set that they are made from.
TEST(StagedFolderTest, RefusesToReplaceAnotherKind) {
  const TempFolder temp;
  const fs::path folder = temp.path() / "set";
  {
    StagedFolder staged(folder, "a data set");
    WriteFileAtomically(staged.staging() / "picture.png", "picture");
    staged.Commit();
  }
  EXPECT_THAT(InputErrorOf([&] { StagedFolder(folder, "the results of a run"); }),
              HasSubstr("contains a data set, which the results of a run would replace; name another folder"));
  StagedFolder(folder, "a data set").Commit();
  EXPECT_FALSE(fs::exists(folder / "picture.png"));
}

TEST(StagedFolderTest, RefusesAFileOfTheSameNameThatIsNotItsOwn) {
  const TempFolder folder;
  WriteResults(folder / "a", "old");
  Write(folder / "a/more.txt", "mine");
  StagedFolder staged(folder / "a");
  Write(staged.staging() / "more.txt", "new");
  EXPECT_THAT(InputErrorOf([&] { staged.Commit(); }), HasSubstr("more.txt: was not written by heba"));
  EXPECT_EQ(ReadTextFile(folder / "a/more.txt"), "mine");
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "old");
}

TEST(StagedFolderTest, NeverReplacesOtherThings) {
  const TempFolder folder;
  fs::create_directory(folder / "photos");
  Write(folder / "photos/holiday.jpg", "x");
  Write(folder / "photos/result.json", "x");
  Write(folder / "file", "x");
  EXPECT_THAT(InputErrorOf([&] { StagedFolder(folder / "photos"); }), HasSubstr("was not created by heba"));
  EXPECT_THAT(InputErrorOf([&] { StagedFolder(folder / "file"); }), HasSubstr("is a file"));
  EXPECT_THAT(InputErrorOf([&] { StagedFolder(folder / "file/below"); }), HasSubstr("cannot be created"));
  EXPECT_EQ(ReadTextFile(folder / "photos/holiday.jpg"), "x");
  EXPECT_EQ(ReadTextFile(folder / "file"), "x");
  // A link is followed and stays.
  fs::create_directory(folder / "elsewhere");
  fs::create_symlink("elsewhere", folder / "link");
  WriteResults(folder / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(ReadTextFile(folder / "elsewhere/result.json"), "new");
}

TEST(StagedFolderTest, OlderResultsStayUntilCommit) {
  const TempFolder folder;
  WriteResults(folder / "a", "old");
  {
    const StagedFolder staged(folder / "a");
    Write(staged.staging() / "result.json", "new");
    EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "old");
  }
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "old");
}

TEST(StagedFolderTest, StaleFoldersOfItsOwnAreRemovedAndNoOthers) {
  const TempFolder folder;
  // A program that was killed leaves a record that nobody locks.
  fs::create_directory(folder / ".a.part-0123456789abcdef");
  Write(folder / ".a.part-0123456789abcdef/.heba", "heba folder 1\n");
  for (const char* name : {".archive.part3", ".mine.part-0123456789abcdef", ".notes.part2021"}) {
    fs::create_directory(folder / name);
    Write(folder / name / "file", "mine");
  }
  const StagedFolder at_work(folder / "b");
  RemoveStaleStaging(folder.path());
  EXPECT_FALSE(fs::exists(folder / ".a.part-0123456789abcdef"));
  EXPECT_TRUE(fs::exists(at_work.staging()));
  EXPECT_EQ(NumEntries(folder.path()), 4);
}

TEST(StagedFolderTest, TwoWithOneNameStageSeparately) {
  const TempFolder folder;
  StagedFolder first(folder / "a");
  StagedFolder second(folder / "a");
  EXPECT_NE(first.staging(), second.staging());
  Write(first.staging() / "result.json", "first");
  Write(second.staging() / "result.json", "second");
  first.Commit();
  second.Commit();
  EXPECT_EQ(ReadTextFile(folder / "a/result.json"), "second");
}

TEST(StagedFolderTest, RemovesAbandonedStagingFolders) {
  const TempFolder folder;
  const StagedFolder staged(folder / "a");
  Write(staged.staging() / "result.json", "1");
  AbandonStaging();
  EXPECT_EQ(NumEntries(folder.path()), 0);
}

}  // namespace
}  // namespace heba
