// The codes of ring-coded points: which words of black and white sectors are used, and which id each of them has.
//
// A ring has `bits` equal sectors; a bit is 1 where the sector has the colour of the dot. The word is read with its
// highest bit first, in the sense in which x turns into y: clockwise on the printed sheet, whose y points down. Where
// reading starts cannot be known: all rotations of a word are one code, named by the smallest of them. A mirrored ring
// reads as the word in reverse, which is in general another code.
#pragma once

#include <cstdint>
#include <vector>

namespace heba {

// In radii of the dot: the ring's inner and outer edge, and how far from it there must be nothing else.
constexpr double kRingInner = 2;
constexpr double kRingOuter = 3;
constexpr double kRingQuiet = 3.5;

enum class RingCodeOrder {
  // Codes at the largest distance first, so that small boards have codes that two, or three, wrong bits do not turn
  // into each other: all codes but the two plain rings are gone through by increasing value, and one is taken if its
  // cyclic distance to all that are taken is at least 4; then again with 3, then with 2.
  kSeparation,
  // By increasing value, as the sheets of other software count (from 1: their number is id + 1). Those are the codes of
  // even parity with a pair of opposite sectors that are both 1 (DE 197 33 466 A1, expired), without the full ring.
  kValue,
};

//                          bits: 8   10   12    14
// codes, plain rings left out:  34  106  350  1180
// kSeparation, distance >= 4:    2    6   10    25
//              distance >= 3:    4    8   19    45
//              all:              9   33   89   317
// kValue:                       13   42  147   516
//
// 8, 10, 12 or 14.
bool IsRingSize(int bits);

// The code of a word.
uint32_t RingCodeOf(uint32_t word, int bits);
// The word that starts `count` sectors later.
uint32_t RotateRing(uint32_t word, int count, int bits);
// The number of sectors that must be changed to turn one code into the other, in the best of their rotations.
int RingDistance(uint32_t a, uint32_t b, int bits);
// By increasing value, those taken that are at least `distance` from all taken before and from all of `codes`, which
// they follow.
std::vector<uint32_t> ExtendRingCodes(std::vector<uint32_t> codes, int distance, int bits);

// The code of each id, from 0.
std::vector<uint32_t> RingCodes(int bits, RingCodeOrder order);

}  // namespace heba
