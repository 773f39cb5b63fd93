// Encodes and decodes images with OpenCV's imgcodecs. It depends on a hundred libraries, which take longer to load
// than most commands run. If it is a library of its own, it is therefore loaded when the first image is decoded or
// encoded.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace heba {

// All functions throw cv::Exception as OpenCV's do, and std::runtime_error if OpenCV's library cannot be loaded.

// Decodes the image file in `bytes` without any conversion; the result is empty if it cannot be read.
cv::Mat DecodeImage(const cv::Mat& bytes);

// Encodes an image as a file with this suffix (".png"); the result is empty if it cannot be encoded.
std::vector<unsigned char> EncodeImage(const std::string& suffix, const cv::Mat& image);
std::vector<unsigned char> EncodeJpeg(const cv::Mat& image, int quality);  // `quality`: 0 to 100.

}  // namespace heba
