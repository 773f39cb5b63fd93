// Tests of ring codes: their numbers against an independent count, and the properties that make them codes.
#include "targets/dots/ring_code.h"

#include <algorithm>
#include <bit>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace heba {
namespace {

struct Counts {
  int bits;
  size_t all;  // Number of all codes without plain rings.
  // Sizes of sets that are built greedily by increasing value, each from the empty set.
  size_t distance_2;
  size_t distance_3;
  size_t distance_4;
  // Numbers of leading codes in the list by separation that are at least 4 and at least 3 apart, the size of that
  // list, and the size of the list by value.
  size_t first_4;
  size_t first_3;
  size_t separation;
  size_t value;
};
// The sizes of the greedy sets and of the list by value are published: Petroff's sheets (2018) have 516 codes of 14
// bits.
constexpr Counts kCounts[] = {{8, 34, 16, 5, 2, 2, 4, 9, 13},
                              {10, 106, 52, 8, 6, 6, 8, 33, 42},
                              {12, 350, 172, 18, 10, 10, 19, 89, 147},
                              {14, 1180, 586, 50, 25, 25, 45, 317, 516}};

int LeastDistance(const std::vector<uint32_t>& codes, size_t count, int bits) {
  int least = bits;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < i; ++j) least = std::min(least, RingDistance(codes[i], codes[j], bits));
  }
  return least;
}

TEST(RingCode, NumbersMatchIndependentCounts) {
  for (const Counts& counts : kCounts) {
    EXPECT_TRUE(IsRingSize(counts.bits));
    EXPECT_EQ(ExtendRingCodes({}, 1, counts.bits).size(), counts.all) << counts.bits;
    EXPECT_EQ(ExtendRingCodes({}, 2, counts.bits).size(), counts.distance_2) << counts.bits;
    EXPECT_EQ(ExtendRingCodes({}, 3, counts.bits).size(), counts.distance_3) << counts.bits;
    EXPECT_EQ(ExtendRingCodes({}, 4, counts.bits).size(), counts.distance_4) << counts.bits;
    EXPECT_EQ(RingCodes(counts.bits, RingCodeOrder::kSeparation).size(), counts.separation) << counts.bits;
    EXPECT_EQ(RingCodes(counts.bits, RingCodeOrder::kValue).size(), counts.value) << counts.bits;
  }
  EXPECT_FALSE(IsRingSize(9));
  EXPECT_FALSE(IsRingSize(16));
}

TEST(RingCode, FirstCodesHaveTheLargestDistances) {
  for (const Counts& counts : kCounts) {
    const std::vector<uint32_t> codes = RingCodes(counts.bits, RingCodeOrder::kSeparation);
    EXPECT_EQ(LeastDistance(codes, counts.first_4, counts.bits), 4) << counts.bits;
    EXPECT_EQ(LeastDistance(codes, counts.first_4 + 1, counts.bits), 3) << counts.bits;
    EXPECT_EQ(LeastDistance(codes, counts.first_3, counts.bits), 3) << counts.bits;
    EXPECT_EQ(LeastDistance(codes, counts.first_3 + 1, counts.bits), 2) << counts.bits;
    EXPECT_EQ(LeastDistance(codes, codes.size(), counts.bits), 2) << counts.bits;
  }
}

TEST(RingCode, IsTheSmallestRotationAndUnique) {
  for (const Counts& counts : kCounts) {
    for (const RingCodeOrder order : {RingCodeOrder::kSeparation, RingCodeOrder::kValue}) {
      const std::vector<uint32_t> codes = RingCodes(counts.bits, order);
      EXPECT_EQ(std::set<uint32_t>(codes.begin(), codes.end()).size(), codes.size());
      for (const uint32_t code : codes) {
        for (int count = 0; count < counts.bits; ++count) {
          EXPECT_EQ(RingCodeOf(RotateRing(code, count, counts.bits), counts.bits), code);
        }
      }
    }
  }
}

// The codes have even parity and at least one pair of opposite sectors, and are sorted by value. The first code of 14
// bits is 0b10000001.
TEST(RingCode, ListByValueMatchesThePatent) {
  for (const Counts& counts : kCounts) {
    const std::vector<uint32_t> codes = RingCodes(counts.bits, RingCodeOrder::kValue);
    EXPECT_TRUE(std::is_sorted(codes.begin(), codes.end()));
    for (const uint32_t code : codes) {
      EXPECT_EQ(std::popcount(code) % 2, 0);
      EXPECT_NE(code & (code >> (counts.bits / 2)), 0U);
    }
  }
  EXPECT_EQ(RingCodes(14, RingCodeOrder::kValue).front(), 129U);
}

TEST(RingCode, DistanceIsTheMinimumOverRotations) {
  EXPECT_EQ(RingDistance(0b00000001, 0b00000001, 8), 0);
  EXPECT_EQ(RingDistance(0b00000001, 0b00010000, 8), 0);
  EXPECT_EQ(RingDistance(0b00000011, 0b00000101, 8), 2);
  EXPECT_EQ(RingDistance(0b00000001, 0b00000111, 8), 2);
  EXPECT_EQ(RotateRing(0b10000001, 1, 8), 0b00000011U);
}

}  // namespace
}  // namespace heba
