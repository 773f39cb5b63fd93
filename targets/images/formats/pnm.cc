// PBM, PGM and PPM, as text (P1, P2, P3) or as bytes (P4, P5, P6).
#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "targets/images/formats/format.h"

namespace heba {
namespace {

using std::string_view;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsSpace(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

bool IsPnm(string_view bytes) {
  return bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' && IsSpace(bytes[2]);
}

// A header consists of a magic number (P1 to P6), white space, and width and height in digits, separated by white space
// and comments.
ImageHeader HeaderOf(string_view bytes) {
  std::array<double, 2> sizes{};
  size_t at = 2;
  for (double& size : sizes) {
    const auto is_digit = [&] { return at < bytes.size() && IsDigit(bytes[at]); };
    for (; at < bytes.size() && !is_digit(); ++at) {
      if (bytes[at] == '#') at = std::min(bytes.find_first_of("\r\n", at), bytes.size());
    }
    for (; is_digit(); ++at) size = 10 * size + (bytes[at] - '0');
  }
  return {sizes[0], sizes[1]};
}

// Reads the numbers of a header or of an image as text.
class NumberReader {
 public:
  explicit NumberReader(string_view bytes) : bytes_(bytes) {}

  // Returns the next number, which has one digit if `is_digit`, or nothing if there is none. The byte behind a number
  // is passed over.
  std::optional<int> Next(bool is_digit = false) {
    while (at_ < bytes_.size() && !IsDigit(bytes_[at_])) {
      if (bytes_[at_] == '#') at_ = std::min(bytes_.find_first_of("\r\n", at_), bytes_.size());
      if (at_ < bytes_.size() && !IsSpace(bytes_[at_])) return std::nullopt;
      ++at_;
    }
    if (at_ >= bytes_.size()) return std::nullopt;
    int64_t value = 0;
    for (; at_ < bytes_.size() && IsDigit(bytes_[at_]); ++at_) {
      value = 10 * value + (bytes_[at_] - '0');
      if (value > std::numeric_limits<int>::max()) return std::nullopt;
      if (is_digit) {
        ++at_;
        return static_cast<int>(value);
      }
    }
    ++at_;
    return static_cast<int>(value);
  }
  string_view rest() const { return bytes_.substr(std::min(at_, bytes_.size())); }

 private:
  string_view bytes_;
  size_t at_ = 2;  // Behind the magic number.
};

struct Layout {
  int width = 0;
  int height = 0;
  int largest = 1;  // The value of white.
  bool is_text = false;
  bool is_bits = false;
  int channels = 1;

  int bytes_per_value() const { return largest > 255 ? 2 : 1; }
  size_t values_per_row() const { return static_cast<size_t>(width) * static_cast<size_t>(channels); }
};

// Reads the pixels of an image. Values of text are stretched to 255 if they have 8 bits, and those of bytes are not: as
// in OpenCV.
class PixelReader {
 public:
  PixelReader(const Layout& layout, const cv::Mat& image) : layout_(layout), image_(image) {}

  // These return false if values are missing.
  bool ReadText(NumberReader numbers);
  bool ReadBytes(string_view bytes);

 private:
  void Set(int row, size_t i, int value);

  const Layout& layout_;
  cv::Mat image_;
};

void PixelReader::Set(int row, size_t i, int value) {
  // The channels are red, green, blue in the file.
  const size_t place = layout_.channels == 3 ? i - i % 3 + (2 - i % 3) : i;
  if (image_.depth() == CV_16U) {
    image_.ptr<uint16_t>(row)[place] = static_cast<uint16_t>(value);
  } else {
    image_.ptr(row)[place] = static_cast<uchar>(value);
  }
}

bool PixelReader::ReadText(NumberReader numbers) {
  for (int row = 0; row < layout_.height; ++row) {
    for (size_t i = 0; i < layout_.values_per_row(); ++i) {
      const std::optional<int> number = numbers.Next(layout_.is_bits);
      if (!number) return false;
      int value = std::min(*number, layout_.largest);
      if (layout_.is_bits) value = 1 - value;
      Set(row, i, layout_.bytes_per_value() == 1 ? value * 255 / layout_.largest : value);
    }
  }
  return true;
}

bool PixelReader::ReadBytes(string_view bytes) {
  const auto size = static_cast<size_t>(layout_.bytes_per_value());
  const size_t pitch = layout_.is_bits ? (layout_.values_per_row() + 7) / 8 : layout_.values_per_row() * size;
  if (bytes.size() / pitch < static_cast<size_t>(layout_.height)) return false;
  for (int row = 0; row < layout_.height; ++row) {
    const string_view line = bytes.substr(static_cast<size_t>(row) * pitch, pitch);
    if (layout_.channels == 1 && size == 1 && !layout_.is_bits) {
      std::copy(line.begin(), line.end(), image_.ptr<char>(row));
      continue;
    }
    for (size_t i = 0; i < layout_.values_per_row(); ++i) {
      const auto byte = static_cast<unsigned char>(line[layout_.is_bits ? i / 8 : i * size]);
      int value = byte;
      if (layout_.is_bits) value = (byte >> (7 - i % 8) & 1) != 0 ? 0 : 255;
      if (size == 2) value = 256 * byte + static_cast<unsigned char>(line[2 * i + 1]);
      Set(row, i, value);
    }
  }
  return true;
}

Outcome<cv::Mat> Decode(string_view bytes) {
  const char kind = bytes[1];
  Layout layout;
  layout.is_text = kind <= '3';
  layout.is_bits = kind == '1' || kind == '4';
  layout.channels = kind == '3' || kind == '6' ? 3 : 1;
  NumberReader numbers(bytes);
  layout.width = numbers.Next().value_or(0);
  layout.height = numbers.Next().value_or(0);
  if (!layout.is_bits) layout.largest = numbers.Next().value_or(0);
  if (layout.width < 1 || layout.height < 1 || layout.largest < 1 || layout.largest > 65535) {
    return Failure("its header does not give its size and the value of white");
  }
  const Outcome<cv::Mat> image = NewImage(layout.width, layout.height,
                                          CV_MAKETYPE(layout.bytes_per_value() == 1 ? CV_8U : CV_16U, layout.channels));
  if (!image) return image;
  PixelReader reader(layout, *image);
  const bool is_complete = layout.is_text ? reader.ReadText(numbers) : reader.ReadBytes(numbers.rest());
  if (!is_complete) return layout.is_text ? Failure("a number is missing in it, or it is truncated") : CutShort();
  return image;
}

}  // namespace

const ImageFormat& Format_pnm();
const ImageFormat& Format_pnm() {
  static constexpr ImageFormat kFormat = {"PBM/PGM/PPM", &IsPnm, &HeaderOf, &Decode, "", nullptr};
  return kFormat;
}

}  // namespace heba
