// Tests of ring codes: their numbers against an independent count, and the properties that make them codes.
#include "targets/dots/ring_code.h"

#include <algorithm>
#include <bit>
#include <ostream>
#include <set>
#include <string>
#include <tuple>
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
void PrintTo(const Counts& counts, std::ostream* stream) { *stream << counts.bits << " bits"; }

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

class RingSizeTest : public testing::TestWithParam<Counts> {};

TEST_P(RingSizeTest, NumbersMatchIndependentCounts) {
  const Counts& counts = GetParam();
  EXPECT_TRUE(IsRingSize(counts.bits));
  EXPECT_EQ(ExtendRingCodes({}, 1, counts.bits).size(), counts.all);
  EXPECT_EQ(ExtendRingCodes({}, 2, counts.bits).size(), counts.distance_2);
  EXPECT_EQ(ExtendRingCodes({}, 3, counts.bits).size(), counts.distance_3);
  EXPECT_EQ(ExtendRingCodes({}, 4, counts.bits).size(), counts.distance_4);
  EXPECT_EQ(RingCodes(counts.bits, RingCodeOrder::kSeparation).size(), counts.separation);
  EXPECT_EQ(RingCodes(counts.bits, RingCodeOrder::kValue).size(), counts.value);
}

TEST_P(RingSizeTest, FirstCodesHaveTheLargestDistances) {
  const Counts& counts = GetParam();
  const std::vector<uint32_t> codes = RingCodes(counts.bits, RingCodeOrder::kSeparation);
  EXPECT_EQ(LeastDistance(codes, counts.first_4, counts.bits), 4);
  EXPECT_EQ(LeastDistance(codes, counts.first_4 + 1, counts.bits), 3);
  EXPECT_EQ(LeastDistance(codes, counts.first_3, counts.bits), 3);
  EXPECT_EQ(LeastDistance(codes, counts.first_3 + 1, counts.bits), 2);
  EXPECT_EQ(LeastDistance(codes, codes.size(), counts.bits), 2);
}

// The codes have even parity and at least one pair of opposite sectors, and are sorted by value.
TEST_P(RingSizeTest, ListByValueMatchesThePatent) {
  const int bits = GetParam().bits;
  const std::vector<uint32_t> codes = RingCodes(bits, RingCodeOrder::kValue);
  EXPECT_TRUE(std::is_sorted(codes.begin(), codes.end()));
  for (const uint32_t code : codes) {
    EXPECT_EQ(std::popcount(code) % 2, 0);
    EXPECT_NE(code & (code >> (bits / 2)), 0U);
  }
}

INSTANTIATE_TEST_SUITE_P(, RingSizeTest, testing::ValuesIn(kCounts),
                         [](const auto& test) { return std::to_string(test.param.bits) + "_bits"; });

// All numbers of bits and orders of the list.
class RingCodeListTest : public testing::TestWithParam<std::tuple<int, RingCodeOrder>> {};

TEST_P(RingCodeListTest, CodesAreTheSmallestRotationsAndUnique) {
  const auto& [bits, order] = GetParam();
  const std::vector<uint32_t> codes = RingCodes(bits, order);
  EXPECT_EQ(std::set<uint32_t>(codes.begin(), codes.end()).size(), codes.size());
  for (const uint32_t code : codes) {
    for (int count = 0; count < bits; ++count) EXPECT_EQ(RingCodeOf(RotateRing(code, count, bits), bits), code);
  }
}

INSTANTIATE_TEST_SUITE_P(, RingCodeListTest,
                         testing::Combine(testing::Values(8, 10, 12, 14),
                                          testing::Values(RingCodeOrder::kSeparation, RingCodeOrder::kValue)),
                         [](const auto& test) {
                           return std::to_string(std::get<0>(test.param)) + "_bits_by_" +
                                  (std::get<1>(test.param) == RingCodeOrder::kValue ? "value" : "separation");
                         });

TEST(RingCode, RefusesOtherRingSizes) {
  EXPECT_FALSE(IsRingSize(9));
  EXPECT_FALSE(IsRingSize(16));
}

TEST(RingCode, FirstCodeByValueHasOppositeSectors) {
  EXPECT_EQ(RingCodes(14, RingCodeOrder::kValue).front(), 0b10000001U);
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
