// Encoded pictures, by OpenCV's imgcodecs. It brings a hundred libraries, which take longer to load than most commands
// run: where it is a library of its own, it is loaded when the first picture is decoded or encoded.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace heba {

// All throw cv::Exception as OpenCV's functions do, and std::runtime_error if its library is not there.

// The picture in `bytes` as it is stored; empty if it cannot be read.
cv::Mat DecodeImage(const cv::Mat& bytes);

// The bytes of a file with this suffix (".png"); none if it cannot be written.
std::vector<unsigned char> EncodeImage(const std::string& suffix, const cv::Mat& image);
std::vector<unsigned char> EncodeJpeg(const cv::Mat& image, int quality);  // 0 to 100

}  // namespace heba
