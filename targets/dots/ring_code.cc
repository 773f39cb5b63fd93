#include "targets/dots/ring_code.h"

#include <algorithm>
#include <bit>

#include "heba/base/error.h"

namespace heba {
namespace {

// Returns all codes by increasing value, without the two plain rings.
std::vector<uint32_t> AllCodes(int bits) {
  std::vector<uint32_t> codes;
  const uint32_t full = (1U << bits) - 1;
  for (uint32_t word = 1; word < full; ++word) {
    if (RingCodeOf(word, bits) == word) codes.push_back(word);
  }
  return codes;
}

}  // namespace

bool IsRingSize(int bits) { return bits == 8 || bits == 10 || bits == 12 || bits == 14; }

uint32_t RotateRing(uint32_t word, int count, int bits) {
  CHECK(count >= 0 && count < bits);
  const uint32_t full = (1U << bits) - 1;
  return ((word << count) | (word >> (bits - count))) & full;
}

uint32_t RingCodeOf(uint32_t word, int bits) {
  uint32_t smallest = word;
  for (int count = 1; count < bits; ++count) smallest = std::min(smallest, RotateRing(word, count, bits));
  return smallest;
}

int RingDistance(uint32_t a, uint32_t b, int bits) {
  int distance = bits;
  for (int count = 0; count < bits; ++count) {
    distance = std::min(distance, static_cast<int>(std::popcount(a ^ RotateRing(b, count, bits))));
  }
  return distance;
}

std::vector<uint32_t> ExtendRingCodes(std::vector<uint32_t> codes, int distance, int bits) {
  CHECK(IsRingSize(bits)) << bits;
  for (const uint32_t code : AllCodes(bits)) {
    const bool is_far = std::all_of(codes.begin(), codes.end(),
                                    [&](uint32_t taken) { return RingDistance(code, taken, bits) >= distance; });
    if (is_far) codes.push_back(code);
  }
  return codes;
}

std::vector<uint32_t> RingCodes(int bits, RingCodeOrder order) {
  CHECK(IsRingSize(bits)) << bits;
  std::vector<uint32_t> codes;
  if (order == RingCodeOrder::kSeparation) {
    for (const int distance : {4, 3, 2}) codes = ExtendRingCodes(std::move(codes), distance, bits);
    return codes;
  }
  for (const uint32_t code : AllCodes(bits)) {
    const uint32_t opposite = RotateRing(code, bits / 2, bits);
    if (std::popcount(code) % 2 == 0 && (code & opposite) != 0) codes.push_back(code);
  }
  return codes;
}

}  // namespace heba
