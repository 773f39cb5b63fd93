#include "targets/images/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string_view>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "targets/images/image_codecs.h"
#include "targets/images/image_format.h"

namespace heba {
namespace {

constexpr size_t kMaxImageBytes = size_t{1} << 30;

}  // namespace

std::optional<ImageSize> ReadImageSize(const std::filesystem::path& path) {
  const std::optional<ImageHeader> header = ReadImageHeader(ReadTextFile(path, kMaxImageBytes));
  constexpr double kMostPx = 1e6;
  if (!header || !(header->width_px >= 1 && header->height_px >= 1) || header->width_px > kMostPx ||
      header->height_px > kMostPx) {
    return std::nullopt;
  }
  return ImageSize{static_cast<int>(header->width_px), static_cast<int>(header->height_px)};
}

cv::Mat ReadGreyImage(const std::filesystem::path& path, const std::optional<ImageSize>& expected) {
  const std::string bytes = ReadTextFile(path, kMaxImageBytes);
  if (bytes.empty()) throw InputError(path.string() + ": is empty; an image is needed");
  const std::optional<ImageHeader> header = ReadImageHeader(bytes);
  if (!header) {
    const std::string_view unread = UnreadFormatName(bytes);
    if (unread.empty()) {
      throw InputError(path.string() + ": is not an image of a format that heba reads: " + ImageFormatNames());
    }
    throw InputError(path.string() + ": is " + std::string(unread) +
                     " image, which heba does not read; convert it to PNG");
  }
  if (header->is_cut_short) throw InputError(path.string() + ": the image is truncated; copy it again");
  if (!(header->width_px >= 1 && header->height_px >= 1)) {
    throw InputError(path.string() + ": cannot be read as an image: its header does not give its size");
  }
  if (header->width_px * header->height_px > kMostImagePixels) {
    throw InputError(path.string() + ": claims to have more than 400 million pixels, which is the limit of heba");
  }
  if (expected && (header->width_px != expected->width_px || header->height_px != expected->height_px)) {
    throw InputError(path.string() + ": is " + ImageSizeText(header->width_px, header->height_px) + ", not " +
                     ImageSizeText(expected->width_px, expected->height_px) +
                     " like the first image; all images must come from one camera at one resolution");
  }
  const Outcome<cv::Mat> decoded = DecodeImage(bytes);
  if (!decoded) throw InputError(path.string() + ": cannot be read as an image: " + decoded.reason());
  cv::Mat image = *decoded;
  if (image.depth() == CV_16U) {
    double brightest = 0;
    cv::minMaxLoc(image.reshape(1), nullptr, &brightest);
    image.convertTo(image, CV_8U, brightest > 0 ? 255.0 / brightest : 1.0);
  }
  if (image.channels() == 3) cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
  if (image.channels() == 4) cv::cvtColor(image, image, cv::COLOR_BGRA2GRAY);
  return image;
}

std::string SmallJpeg(const cv::Mat& grey, int max_width_px) {
  constexpr int kQuality = 60;
  cv::Mat small = grey;
  if (grey.cols > max_width_px) {
    const int height = std::max(1, static_cast<int>(static_cast<int64_t>(grey.rows) * max_width_px / grey.cols));
    cv::resize(grey, small, cv::Size(max_width_px, height), 0, 0, cv::INTER_AREA);
  }
  const Outcome<std::vector<unsigned char>> bytes = EncodeJpeg(small, kQuality);
  return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
}

void WriteImage(const std::filesystem::path& path, const cv::Mat& image) {
  const Outcome<std::vector<unsigned char>> bytes = EncodeImage(path.extension().string(), image);
  if (!bytes) throw InputError(path.string() + ": cannot be encoded: " + bytes.reason());
  WriteFileAtomically(path, std::string_view(reinterpret_cast<const char*>(bytes->data()), bytes->size()));  // NOLINT
}

double NoiseGrey(const cv::Mat& grey) {
  CHECK_EQ(grey.type(), CV_8UC1);
  std::array<int64_t, 256> counts{};
  int64_t num = 0;
  constexpr int kEnoughRows = 256;
  const int stride = std::max(1, grey.rows / kEnoughRows);
  for (int row = stride / 2; row < grey.rows; row += stride) {
    const auto* const line = grey.ptr<uchar>(row);
    for (int column = 0; column + 1 < grey.cols; ++column, ++num) {
      ++counts[static_cast<size_t>(std::abs(line[column + 1] - line[column]))];
    }
  }
  // An integer difference d represents all real ones from d - 1/2 to d + 1/2.
  const double wanted = 0.5 * static_cast<double>(num);
  double below = 0;
  for (size_t difference = 0; difference < counts.size() && num > 0; ++difference) {
    const auto count = static_cast<double>(counts[difference]);
    if (below + count < wanted) {
      below += count;
      continue;
    }
    const double first = difference == 0 ? 0.0 : static_cast<double>(difference) - 0.5;
    const double width = difference == 0 ? 0.5 : 1.0;
    // Half of the absolute values of a normal distribution lie below 0.6745 sigma; a difference has twice the
    // variance.
    return (first + width * (wanted - below) / count) / (0.6745 * std::sqrt(2.0));
  }
  return 0;
}

}  // namespace heba
