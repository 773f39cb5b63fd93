#include "targets/types/likely_misconfigurations.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

std::vector<int> Range(int first, int count) {
  std::vector<int> ids(static_cast<size_t>(count));
  std::iota(ids.begin(), ids.end(), first);
  return ids;
}
std::vector<std::string> Starts(const std::vector<TargetSettings>& confusions) {
  std::vector<std::string> starts;
  for (const TargetSettings& settings : confusions) starts.push_back(settings.front().second);
  return starts;
}

TEST(OtherFirstIdsTest, AWholeTargetHasOneFirstId) {
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(24, 36), 0, 36)), testing::ElementsAre("24"));
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(0, 36), 1, 36)), testing::ElementsAre("0"));
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(24, 36), 24, 36)), testing::IsEmpty());
}

TEST(OtherFirstIdsTest, ListsAllPossibleFirstIdsIfTheEndsAreNotSeen) {
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(25, 34), 0, 36)), testing::ElementsAre("25", "24", "23"));
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(2, 30), 0, 36)), testing::ElementsAre("2", "1"));
  // If there are many candidates, only the first and last are given.
  EXPECT_THAT(Starts(OtherFirstIds("first_id", Range(50, 6), 0, 36)), testing::ElementsAre("50", "20"));
}

TEST(OtherFirstIdsTest, IgnoresStrayIds) {
  std::vector<int> seen = Range(100, 12);
  seen.push_back(7);
  seen.push_back(3);
  EXPECT_THAT(Starts(OtherFirstIds("first_id", seen, 0, 12)), testing::ElementsAre("100"));
  EXPECT_THAT(Starts(OtherFirstIds("first_id", {}, 0, 12)), testing::IsEmpty());
}

}  // namespace
}  // namespace heba
