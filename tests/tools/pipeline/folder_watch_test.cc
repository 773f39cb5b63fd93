#include "tools/pipeline/folder_watch.h"

#include <thread>

#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using std::chrono::milliseconds;

// Long enough for any machine: a wait ends when something happens.
constexpr milliseconds kPatience(20000);

TEST(FolderWatchTest, ReportsFilesThatWereClosedOrMoved) {
  const TempFolder folder;
  fs::create_directory(folder / "images");
  FolderWatch watch;
  watch.Follow({folder / "images", folder / "none"});
  std::thread writer([&] { WriteFileAtomically(folder / "images/1.png", "image"); });
  std::set<fs::path> complete;
  // Creation is an event of its own.
  for (int k = 0; k < 5 && !complete.contains(folder / "images/1.png"); ++k) complete.merge(watch.Wait(kPatience));
  writer.join();
  EXPECT_TRUE(complete.contains(folder / "images/1.png"));
  EXPECT_TRUE(watch.Wait(milliseconds(1)).empty());
}

TEST(FolderWatchTest, WaitsNoLongerThanItIsTold) {
  const TempFolder folder;
  FolderWatch watch;
  watch.Follow({folder.path()});
  EXPECT_TRUE(watch.Wait(milliseconds(1)).empty());
}

}  // namespace
}  // namespace heba
