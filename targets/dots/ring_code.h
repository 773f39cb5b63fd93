// The codes of ring-coded points: the words of black and white sectors that are used, and the id of each.
//
// A ring has `bits` equal sectors; a bit is 1 if the sector has the colour of the dot. The word is read from its
// highest bit on, in the direction in which x rotates into y: clockwise on the printed sheet, whose y axis points
// down. The start of the reading cannot be known, so all rotations of a word are one code, named by the smallest of
// them. A mirrored ring reads as the reversed word, which is in general another code.
#pragma once

#include <cstdint>
#include <vector>

namespace heba {

// Inner and outer radius of the ring, and the radius within which there must be nothing else, in radii of the dot.
constexpr double kRingInner = 2;
constexpr double kRingOuter = 3;
constexpr double kRingQuiet = 3.5;

enum class RingCodeOrder {
  // Codes at the largest distance come first, so that targets with few points have codes that two, or three, wrong
  // bits do not convert into each other. All codes except the two plain rings are visited by increasing value, and
  // one is taken if its cyclic distance to all that are taken is at least 4; then again with 3, then with 2.
  kSeparation,
  // Codes are ordered by value, as on the sheets of other software (which counts from 1: its number is id + 1). These
  // are the codes of even parity with a pair of opposite sectors that are both 1 (DE 197 33 466 A1, expired), without
  // the full ring.
  kValue,
};

// Returns whether `bits` is 8, 10, 12 or 14, the sizes of rings that are supported.
//
// Number of codes:
//                          bits: 8   10   12    14
// codes, plain rings left out:  34  106  350  1180
// kSeparation, distance >= 4:    2    6   10    25
//              distance >= 3:    4    8   19    45
//              all:              9   33   89   317
// kValue:                       13   42  147   516
bool IsRingSize(int bits);

// Returns the code of a word, which is its smallest rotation.
uint32_t RingCodeOf(uint32_t word, int bits);
// Returns the word that is read if reading starts `count` sectors later.
uint32_t RotateRing(uint32_t word, int count, int bits);
// Returns the number of sectors that must be changed to convert one code into the other, at their best rotations.
int RingDistance(uint32_t a, uint32_t b, int bits);
// Appends to `codes`, by increasing value, every code that is at least `distance` from all codes before it.
std::vector<uint32_t> ExtendRingCodes(std::vector<uint32_t> codes, int distance, int bits);

// Returns the code of each id, starting with id 0.
std::vector<uint32_t> RingCodes(int bits, RingCodeOrder order);

}  // namespace heba
