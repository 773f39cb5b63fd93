// Makes image files of all kinds that a format has, by the formats' own libraries.
#pragma once

#include <string>
#include <vector>

namespace heba {

struct MadeImage {
  std::string name;
  std::string bytes;
  bool is_read_as_by_opencv_4_6 = false;  // Later versions of OpenCV read other pixels.
};

// Grey, colours and palettes of all depths, with and without transparency, interlaced and not.
std::vector<MadeImage> MadePngs();
// Grey, colours at all usual resolutions and inks; sequential, progressive, with restarts, with an orientation, as a
// frame of a film without tables.
std::vector<MadeImage> MadeJpegs();
// Strips and tiles of all depths and compressions.
std::vector<MadeImage> MadeTiffs();
// The same, with an orientation in the metadata; the first has none.
std::vector<MadeImage> TurnedTiffs();
// Palettes, run lengths and 16 to 32 bits.
std::vector<MadeImage> MadeBmps();
// P1 to P6.
std::vector<MadeImage> MadePnms();

}  // namespace heba
