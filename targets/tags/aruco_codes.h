// The codes of the markers with 4 x 4 to 7 x 7 cells that OpenCV predefines (DICT_4X4_1000 to DICT_7X7_1000). Each code
// has the cells inside the border row by row from the top left, white as 1; the last cell is the lowest bit. The
// smaller dictionaries are the beginnings of these.
#pragma once

#include <array>
#include <cstdint>

namespace heba {

extern const std::array<uint16_t, 1000> kArucoCodes4x4;
extern const std::array<uint32_t, 1000> kArucoCodes5x5;
extern const std::array<uint64_t, 1000> kArucoCodes6x6;
extern const std::array<uint64_t, 1000> kArucoCodes7x7;

}  // namespace heba
