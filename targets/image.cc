#include "targets/image.h"

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"

namespace heba {
namespace {

constexpr size_t kMaxImageBytes = size_t{1} << 30;

// Whether a PNG or a JPEG is there to its end: decoders fill what is missing with grey and only print a warning.
bool IsCutShort(const std::string& bytes) {
  using std::string_view;
  const string_view view(bytes);
  if (view.substr(0, 8) == string_view("\x89PNG\r\n\x1a\n", 8)) {
    // Chunks: length, type, data, checksum; the last is IEND.
    size_t at = 8;
    while (at + 12 <= view.size()) {
      size_t length = 0;
      for (size_t i = 0; i < 4; ++i) length = (length << 8) | static_cast<unsigned char>(view[at + i]);
      if (view.substr(at + 4, 4) == "IEND") return false;
      at += 12 + length;
    }
    return true;
  }
  if (view.substr(0, 3) == string_view("\xff\xd8\xff", 3)) {
    // The end marker may be followed by what a camera or an editor added.
    return view.rfind(string_view("\xff\xd9", 2)) == string_view::npos;
  }
  return false;
}

// The number of pixels that the header of a PNG, JPEG, BMP or PNM claims; nothing if it is none of them. What is
// claimed is what a decoder allocates, whatever follows.
std::optional<double> PixelsClaimed(std::string_view bytes) {
  const auto number = [&](size_t at, size_t count, bool is_big_endian) {
    double value = 0;
    for (size_t i = 0; i < count; ++i) {
      const size_t k = at + (is_big_endian ? i : count - 1 - i);
      value = 256 * value + (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0);
    }
    return value;
  };
  if (bytes.starts_with("\x89PNG")) return number(16, 4, true) * number(20, 4, true);
  if (bytes.starts_with("BM")) {
    constexpr double kOldHeader = 12;  // OS/2's, with sizes of 16 bits.
    if (number(14, 4, false) == kOldHeader) return number(18, 2, false) * number(20, 2, false);
    // Heights below zero stand for pictures from top to bottom.
    const double height = number(22, 4, false);
    return number(18, 4, false) * std::min(height, 4294967296.0 - height);
  }
  if (bytes.starts_with("\xff\xd8\xff")) {
    // Segments: marker, length; the frame's is one of C0 to CF but C4, C8 and CC.
    for (size_t at = 2; at + 9 < bytes.size() && bytes[at] == '\xff';) {
      const auto marker = static_cast<unsigned char>(bytes[at + 1]);
      if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
        return number(at + 5, 2, true) * number(at + 7, 2, true);
      }
      at += 2 + static_cast<size_t>(number(at + 2, 2, true));
    }
    return std::nullopt;
  }
  if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') {
    std::istringstream header(std::string(bytes.substr(2, 200)));
    double width = 0;
    double height = 0;
    if (header >> width >> height) return width * height;
  }
  return std::nullopt;
}

}  // namespace

cv::Mat ReadGreyImage(const std::filesystem::path& path) {
  const std::string bytes = ReadTextFile(path, kMaxImageBytes);
  if (bytes.empty()) throw InputError(path.string() + ": is empty; a picture is needed");
  if (IsCutShort(bytes)) throw InputError(path.string() + ": the picture is cut short; copy it again");
  constexpr double kMaxPixels = 4e8;
  if (PixelsClaimed(bytes).value_or(0) > kMaxPixels) {
    throw InputError(path.string() +
                     ": claims to have more than 400 million pixels; no camera that heba knows of does");
  }
  cv::Mat image;
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));  // NOLINT
    image = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception& error) {
    throw InputError(path.string() + ": is not a picture that can be read (" + error.err + ")");
  }
  if (image.empty()) throw InputError(path.string() + ": is not a picture that can be read, or is cut short");
  if (image.depth() == CV_16U) {
    double brightest = 0;
    cv::minMaxLoc(image.reshape(1), nullptr, &brightest);
    image.convertTo(image, CV_8U, brightest > 0 ? 255.0 / brightest : 1.0);
  } else if (image.depth() != CV_8U) {
    throw InputError(path.string() + ": has neither 8 nor 16 bits a channel; save it as one of these");
  }
  if (image.channels() == 3) cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
  if (image.channels() == 4) cv::cvtColor(image, image, cv::COLOR_BGRA2GRAY);
  if (image.channels() != 1) throw InputError(path.string() + ": has 2 channels; grey or colour is needed");
  return image;
}

std::string SmallJpeg(const cv::Mat& grey, int max_width_px) {
  constexpr int kQuality = 60;
  cv::Mat small = grey;
  if (grey.cols > max_width_px) {
    const int height = std::max(1, static_cast<int>(static_cast<int64_t>(grey.rows) * max_width_px / grey.cols));
    cv::resize(grey, small, cv::Size(max_width_px, height), 0, 0, cv::INTER_AREA);
  }
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {bytes.begin(), bytes.end()};
}

void WriteImage(const std::filesystem::path& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  try {
    if (!cv::imencode(path.extension().string(), image, bytes)) throw InputError(path.string() + ": cannot be encoded");
  } catch (const cv::Exception& error) {
    throw InputError(path.string() + ": cannot be encoded (" + error.err + ")");
  }
  WriteFileAtomically(path, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));  // NOLINT
}

}  // namespace heba
