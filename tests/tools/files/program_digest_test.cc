// Tests of tools/files/program_digest.h.
#include "tools/files/program_digest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/run/digest.h"

namespace heba {
namespace {
using ::testing::MatchesRegex;

TEST(DigestOfProgramTest, IsTheSameInOneProcess) {
  EXPECT_THAT(DigestOfProgram(), MatchesRegex("[0-9a-f]{32}"));
  EXPECT_EQ(DigestOfProgram(), DigestOfProgram());
  EXPECT_NE(DigestOfProgram(), DigestOfFile("/proc/self/exe"));
}

}  // namespace
}  // namespace heba
