// Tests of heba/base/union_find.h.
#include "heba/base/union_find.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

TEST(UnionFindTest, EachElementIsASetAtFirst) {
  UnionFind<int> sets(3);
  EXPECT_EQ(sets.Add(), 3);
  EXPECT_EQ(sets.size(), 4);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(sets.Root(i), i);
    EXPECT_TRUE(sets.IsRoot(i));
  }
}

TEST(UnionFindTest, TheSmallestElementIdentifiesASet) {
  UnionFind<int> sets(5);
  EXPECT_EQ(sets.Unite(4, 2), 2);
  EXPECT_EQ(sets.Unite(4, 3), 2);
  EXPECT_EQ(sets.Unite(3, 1), 1);
  EXPECT_EQ(sets.Unite(3, 4), 1);  // 3 and 4 are united already.
  EXPECT_EQ(sets.Root(4), 1);
  EXPECT_EQ(sets.Root(0), 0);
  EXPECT_FALSE(sets.IsRoot(2));
}

// Compares with labels that are all rewritten at each union.
TEST(UnionFindTest, AgreesWithRewrittenLabels) {
  constexpr int kSize = 200;
  Rng rng(3);
  UnionFind<int> sets(kSize);
  std::vector<int> labels(kSize);
  std::iota(labels.begin(), labels.end(), 0);
  for (int step = 0; step < 180; ++step) {
    const int a = rng.Index(kSize);
    const int b = rng.Index(kSize);
    sets.Unite(a, b);
    const int smaller = std::min(labels.at(a), labels.at(b));
    const int larger = std::max(labels.at(a), labels.at(b));
    for (int& label : labels) {
      if (label == larger) label = smaller;
    }
    for (int i = 0; i < kSize; ++i) ASSERT_EQ(sets.Root(i), labels.at(i)) << "step " << step;
  }
}

}  // namespace
}  // namespace heba
