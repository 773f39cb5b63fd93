// What a picture's bytes say of it before a decoder sees them. Only the formats here are read, each known by its first
// bytes alone as OpenCV knows it: what OpenCV does not know it hands to libraries for maps and medicine, which may read
// other files, and end the program on faults.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace heba {

struct ImageHeader {
  // The size that the header claims, which a decoder would allocate whatever follows; 0 x 0 if it cannot be told.
  double width_px = 0;
  double height_px = 0;
  // Decoders fill what is missing with grey and only print a warning. Known of some formats only.
  bool is_cut_short = false;
};

// Nothing if the bytes are of no format that is read.
std::optional<ImageHeader> ReadImageHeader(std::string_view bytes);

// "PNG, JPEG, ...".
std::string ImageFormatNames();

}  // namespace heba
