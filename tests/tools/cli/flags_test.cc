#include "tools/cli/flags.h"

#include <string>

#include <gflags/gflags.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/input_error.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Restores every flag after a test.
class FlagsTest : public testing::Test {
 private:
  gflags::FlagSaver saver_;
};

TEST_F(FlagsTest, JobsIsTheNumberOfThreads) {
  FLAGS_jobs = 3;
  EXPECT_EQ(NumThreads(), 3);
  FLAGS_jobs = 4096;
  EXPECT_EQ(NumThreads(), 4096);
  FLAGS_jobs = 0;
  EXPECT_GE(NumThreads(), 1);
}

TEST_F(FlagsTest, JobsHasARange) {
  FLAGS_jobs = -1;
  EXPECT_EQ(InputErrorOf([] { NumThreads(); }), "--jobs needs a number from 0 to 4096, not -1");
  FLAGS_jobs = 4097;
  EXPECT_EQ(InputErrorOf([] { NumThreads(); }), "--jobs needs a number from 0 to 4096, not 4097");
}

TEST_F(FlagsTest, SettingsAreAllValuesOfSetInOrder) {
  EXPECT_THAT(Settings(), IsEmpty());
  FLAGS_set = "refine.loss=none";
  EXPECT_THAT(Settings(), ElementsAre("refine.loss=none"));
  FLAGS_set = std::string("refine.loss=none") + kSettingSeparator + "seed=a=b, c";
  EXPECT_THAT(Settings(), ElementsAre("refine.loss=none", "seed=a=b, c"));
}

TEST_F(FlagsTest, FailOnIsAGrade) {
  EXPECT_EQ(FailOn(), std::nullopt);
  FLAGS_fail_on = "bad";
  EXPECT_EQ(FailOn(), Grade::kBad);
  FLAGS_fail_on = "doubtful";
  EXPECT_EQ(FailOn(), Grade::kDoubtful);
}

// A verdict that is good or better would be every one.
TEST_F(FlagsTest, FailOnRefusesOtherWords) {
  for (const char* word : {"good", "none", "worse"}) {
    FLAGS_fail_on = word;
    EXPECT_THAT(InputErrorOf([] { FailOn(); }),
                StartsWith("--fail-on: '" + std::string(word) + "' is unknown; one of: bad, doubtful"));
  }
}

TEST_F(FlagsTest, ShardIsAPartOfTheWork) {
  EXPECT_EQ(ParseShard().index, 0);
  EXPECT_EQ(ParseShard().count, 1);
  FLAGS_shard = "2/3";
  EXPECT_EQ(ParseShard().index, 2);
  EXPECT_EQ(ParseShard().count, 3);
}

TEST_F(FlagsTest, ShardRefusesWhatIsNoPart) {
  for (const char* text : {"3/3", "-1/3", "0/0", "1", "1/", "/3", "1/2/3", "0.5/2", "0/1.5", "a/b", "nan/3", "0/1e7"}) {
    FLAGS_shard = text;
    EXPECT_EQ(InputErrorOf([] { ParseShard(); }),
              "--shard needs I/N with I from 0 to N - 1, not '" + std::string(text) + "'");
  }
}

}  // namespace
}  // namespace heba
