// Reads and writes images, and looks up grey values.
#pragma once

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/data/image_size.h"

namespace heba {

// Reads an image as CV_8UC1. Its format is one of targets/images/image_format.h, grey or colour, with 8 or 16 bits
// per channel; 16-bit values are scaled so that the brightest is 255. Pixels are returned as stored: a rotation in
// the metadata is not applied, since a camera model belongs to the sensor. The size is checked before the image is
// decoded. Throws InputError if the file is missing, truncated, not an image, of another depth, with two channels or
// with more than 400 million pixels, or if its size differs from `expected`.
cv::Mat ReadGreyImage(const std::filesystem::path& path, const std::optional<ImageSize>& expected = std::nullopt);
// Reads the size of an image from the header of its file; returns nothing if the header does not tell it. Throws
// InputError if the file cannot be read.
std::optional<ImageSize> ReadImageSize(const std::filesystem::path& path);

// Writes an image completely or not at all, in the format of the suffix of `path`. Throws InputError if it cannot be
// written.
void WriteImage(const std::filesystem::path& path, const cv::Mat& image);

// Returns a copy of a CV_8UC1 image, no wider than `max_width_px`, as the bytes of a JPEG file.
std::string SmallJpeg(const cv::Mat& grey, int max_width_px);

// Estimates the standard deviation of the pixel noise of a CV_8UC1 image, in grey levels, from the median absolute
// difference of neighbours in a row. Fine texture counts as noise. Returns 0 for an image of one column.
double NoiseGrey(const cv::Mat& grey);

// Returns whether a position lies within the rectangle through the centres of the outermost pixels.
inline bool IsInImage(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= grey.cols - 1 && pixel.y() <= grey.rows - 1;
}

// Interpolates the grey value bilinearly at a position within a CV_8UC1 image (IsInImage) of at least 2 x 2 pixels.
inline double GreyAt(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  const int column = std::min(static_cast<int>(pixel.x()), grey.cols - 2);
  const int row = std::min(static_cast<int>(pixel.y()), grey.rows - 2);
  const double fx = pixel.x() - column;
  const double fy = pixel.y() - row;
  const uchar* const upper = grey.ptr<uchar>(row) + column;
  const uchar* const lower = grey.ptr<uchar>(row + 1) + column;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) + fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

}  // namespace heba
