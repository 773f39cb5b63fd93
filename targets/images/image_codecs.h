// Decodes and encodes images by the libraries of their formats (targets/images/formats.def).
#pragma once

#include <string_view>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "heba/base/error.h"

namespace heba {

// Decodes an image file without any conversion: 1, 3 (blue, green, red) or 4 channels (with alpha) of 8 or 16 bits.
// Palettes become colours, or grey values if all of them are grey; grey with alpha has 4 channels. Pixels are as
// stored; a rotation in the metadata is not applied. The failure is a clause about the file: "it is truncated". May be
// called by several threads at a time.
Outcome<cv::Mat> DecodeImage(std::string_view bytes);

// Encodes an image of 1, 3 or 4 channels of 8 bits, or of 16 bits as PNG, as a file with this suffix: ".png" or ".jpg".
// The failure is a clause about the image.
Outcome<std::vector<unsigned char>> EncodeImage(std::string_view suffix, const cv::Mat& image);
// The same as JPEG. `quality`: 0 to 100.
Outcome<std::vector<unsigned char>> EncodeJpeg(const cv::Mat& image, int quality);

}  // namespace heba
