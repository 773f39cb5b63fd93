#include "targets/images/image_codecs.h"

#include <new>
#include <string>

#include <opencv2/core.hpp>

#include "targets/images/image_format.h"

namespace heba {
namespace {

Outcome<std::vector<unsigned char>> Encoded(std::string_view suffix, const cv::Mat& image, int quality) {
  const ImageFormat* const format = FormatOfSuffix(suffix);
  if (format == nullptr) return Failure("heba writes no images with the suffix '" + std::string(suffix) + "'");
  const int channels = image.channels();
  if (image.empty() || (channels != 1 && channels != 3 && channels != 4)) {
    return Failure("it has " + std::to_string(channels) + " channels and not 1, 3 or 4, or no pixels");
  }
  return format->encode(image, quality);
}

}  // namespace

Outcome<cv::Mat> DecodeImage(std::string_view bytes) {
  const ImageFormat* const format = FormatOf(bytes);
  if (format == nullptr) return Failure("it is not of a format that heba reads");
  try {
    return format->decode(bytes);
  } catch (const cv::Exception& error) {
    return Failure(error.err);
  } catch (const std::bad_alloc&) {
    return Failure("there is not enough memory for it");
  }
}

Outcome<std::vector<unsigned char>> EncodeImage(std::string_view suffix, const cv::Mat& image) {
  constexpr int kGoodQuality = 95;
  return Encoded(suffix, image, kGoodQuality);
}

Outcome<std::vector<unsigned char>> EncodeJpeg(const cv::Mat& image, int quality) {
  return Encoded(".jpg", image, quality);
}

}  // namespace heba
