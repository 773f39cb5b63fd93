// Inspects the bytes of an image file before a decoder does. Only the formats listed here are read, each recognised
// by its first bytes, as in OpenCV. OpenCV passes formats that it does not recognise to libraries for geographic and
// medical data, which may read other files and terminate the program on errors.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace heba {

struct ImageHeader {
  // The image size that the header claims, which a decoder would allocate whatever data follow; 0 x 0 if unknown.
  double width_px = 0;
  double height_px = 0;
  // Whether the file is truncated; detected for PNG and JPEG only. Decoders fill the missing pixels with grey and
  // only print a warning.
  bool is_cut_short = false;
};

// Reads the header of an image file; returns nothing if its format is not supported.
std::optional<ImageHeader> ReadImageHeader(std::string_view bytes);

// Returns the names of the supported formats: "PNG, JPEG, ...".
std::string ImageFormatNames();

}  // namespace heba
