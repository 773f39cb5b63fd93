// What an image format is: a file of this folder and a line of targets/images/formats.def. The pixels of every format
// equal those of OpenCV's cv::imdecode with IMREAD_UNCHANGED.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "heba/base/error.h"

namespace heba {

// Larger images are not decoded.
constexpr double kMostImagePixels = 4e8;

struct ImageHeader {
  // The image size that the header claims, which a decoder would allocate whatever data follow; 0 x 0 if unknown.
  double width_px = 0;
  double height_px = 0;
  // Whether the file is truncated; detected for PNG and JPEG only. Decoders of JPEG fill the missing pixels with grey.
  bool is_cut_short = false;
};

struct ImageFormat {
  std::string_view name;
  // Returns whether the file has the first bytes of the format. The other functions are called only if it has.
  bool (*matches)(std::string_view bytes) = nullptr;
  // Reads the header without any library, however damaged the file is.
  ImageHeader (*header)(std::string_view bytes) = nullptr;
  // Decodes the file, or says why it cannot be decoded. Several threads decode at a time. Nothing is printed.
  Outcome<cv::Mat> (*decode)(std::string_view bytes) = nullptr;
  // The suffix of the files that `encode` makes, or empty if heba does not write the format.
  std::string_view suffix;
  // Encodes an image of 1, 3 or 4 channels with 8 or 16 bits, or says why it cannot be encoded. `quality`, 0 to 100,
  // is for lossy formats.
  Outcome<std::vector<unsigned char>> (*encode)(const cv::Mat& image, int quality) = nullptr;
};

// What a decoder answers to files that end too early.
inline Failure CutShort() { return Failure("it is truncated; copy it again"); }
// What a decoder answers to files that its library leaves with an error.
inline Failure Unreadable(const std::string& library, const std::string& message) {
  return Failure("it is damaged, truncated or of a kind that heba does not read (" + library + ": " + message + ")");
}
// What a decoder answers to other depths than 8 and 16 bits.
inline Failure WrongDepth() { return Failure("it has neither 8 nor 16 bits per channel; save it with 8 or 16"); }

// Makes an image for a decoder to fill, or says why there is none of this size.
inline Outcome<cv::Mat> NewImage(int64_t width_px, int64_t height_px, int type) {
  if (width_px < 1 || height_px < 1) return Failure("its header does not give its size");
  if (static_cast<double>(width_px) * static_cast<double>(height_px) > kMostImagePixels) {
    return Failure("it has more than 400 million pixels, which is the limit of heba");
  }
  return cv::Mat(static_cast<int>(height_px), static_cast<int>(width_px), type);
}

// Reads an unsigned integer of `count` bytes, at most 4; bytes beyond the end count as zero.
inline uint32_t NumberAt(std::string_view bytes, size_t at, size_t count, bool is_big_endian) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t k = at + (is_big_endian ? i : count - 1 - i);
    value = 256 * value + (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0);
  }
  return value;
}

// Returns the brightness of a colour, rounded as OpenCV's decoders do.
inline int BrightnessOf(int blue, int green, int red) {
  constexpr int kBits = 14;  // The weights 0.114, 0.587 and 0.299.
  return (1868 * blue + 9617 * green + 4899 * red + (1 << (kBits - 1))) >> kBits;
}

}  // namespace heba
