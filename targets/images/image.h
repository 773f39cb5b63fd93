// Pictures from files, and their grey values.
#pragma once

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace heba {

// The picture as CV_8UC1: of any format of targets/images/image_format.h, grey or colour, 8 or 16 bit (16-bit values
// are scaled so that the brightest pixel is 255). The file's pixels as they are: a rotation in its metadata is not
// applied, since a camera's model belongs to the sensor. InputError if the file is missing, cut short, no picture, or
// of another depth. Its size is looked at first: with `expected` one of another size is an InputError before it is
// decoded.
struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const ImageSize& other) const = default;
};
cv::Mat ReadGreyImage(const std::filesystem::path& path, const std::optional<ImageSize>& expected = std::nullopt);
// Reads the size from the file's header; nothing if that does not tell it. InputError if the file cannot be read.
std::optional<ImageSize> ReadImageSize(const std::filesystem::path& path);

// Writes a picture whole or not at all; the format follows the suffix. InputError if it cannot be written.
void WriteImage(const std::filesystem::path& path, const cv::Mat& image);

// A copy of a CV_8UC1 picture, no wider than `max_width_px`, as the bytes of a JPEG file.
std::string SmallJpeg(const cv::Mat& grey, int max_width_px);

// The standard deviation of a pixel's noise in grey levels, from the median difference of neighbours in a row, of a
// CV_8UC1 picture; a fine texture counts as noise. 0 for a picture of one column.
double NoiseGrey(const cv::Mat& grey);

// Whether a place lies within the centres of the outermost pixels.
inline bool IsInImage(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= grey.cols - 1 && pixel.y() <= grey.rows - 1;
}

// Bilinear, at a place in the picture, which is CV_8UC1 and has two pixels a side at least.
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
