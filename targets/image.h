// Pictures from files.
#pragma once

#include <filesystem>

#include <opencv2/core/mat.hpp>

namespace heba {

// The picture as CV_8UC1: any format that OpenCV reads, grey or colour, 8 or 16 bit (16-bit values are scaled so that
// the brightest pixel is 255). The file's pixels as they are: a rotation in its metadata is not applied, since a
// camera's model belongs to the sensor. InputError if the file is missing, cut short, no picture, or of another depth.
cv::Mat ReadGreyImage(const std::filesystem::path& path);

// Writes a picture whole or not at all; the format follows the suffix. InputError if it cannot be written.
void WriteImage(const std::filesystem::path& path, const cv::Mat& image);

// Whether a file name has the suffix of a picture.
bool HasImageSuffix(const std::filesystem::path& path);

}  // namespace heba
