// Tests of tools/files/program_digest.h.
#include "tools/files/program_digest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"
#include "tools/run/digest.h"

namespace heba {
namespace {
using ::testing::MatchesRegex;

TEST(DigestOfProgramTest, IsTheSameInOneProcess) {
  EXPECT_THAT(DigestOfProgram(), MatchesRegex("[0-9a-f]{32}"));
  EXPECT_EQ(DigestOfProgram(), DigestOfProgram());
  EXPECT_NE(DigestOfProgram(), DigestOfFile("/proc/self/exe"));
  EXPECT_EQ(DigestOfProgram(), DigestOfProcess("/proc/self"));
}

// In a chroot or a container, /proc may not be mounted.
TEST(DigestOfProcessTest, ExistsWithoutProc) {
  const TempFolder folder;
  const std::string digest = DigestOfProcess(folder / "self");
  EXPECT_THAT(digest, MatchesRegex("[0-9a-f]{32}"));
  EXPECT_NE(digest, DigestOfProgram());
}

}  // namespace
}  // namespace heba
