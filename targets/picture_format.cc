#include "targets/picture_format.h"

#include <algorithm>
#include <sstream>
#include <string>

namespace heba {
namespace {

using std::string_view;

// A whole number of `count` bytes; bytes beyond the end count as zero.
double NumberAt(string_view bytes, size_t at, size_t count, bool is_big_endian) {
  double value = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t k = at + (is_big_endian ? i : count - 1 - i);
    value = 256 * value + (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0);
  }
  return value;
}

bool IsPng(string_view bytes) { return bytes.starts_with(string_view("\x89PNG\r\n\x1a\n", 8)); }
std::optional<double> PixelsOfPng(string_view bytes) {
  return NumberAt(bytes, 16, 4, true) * NumberAt(bytes, 20, 4, true);
}
// Chunks: length, type, data, checksum; the last is IEND.
bool IsPngCutShort(string_view bytes) {
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    if (bytes.substr(at + 4, 4) == "IEND") return false;
    at += 12 + static_cast<size_t>(NumberAt(bytes, at, 4, true));
  }
  return true;
}

bool IsJpeg(string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }
// Segments: marker, length; the frame's is one of C0 to CF but C4, C8 and CC.
std::optional<double> PixelsOfJpeg(string_view bytes) {
  for (size_t at = 2; at + 9 < bytes.size() && bytes[at] == '\xff';) {
    const auto marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      return NumberAt(bytes, at + 5, 2, true) * NumberAt(bytes, at + 7, 2, true);
    }
    at += 2 + static_cast<size_t>(NumberAt(bytes, at + 2, 2, true));
  }
  return std::nullopt;
}
// The end marker may be followed by what a camera or an editor added.
bool IsJpegCutShort(string_view bytes) { return bytes.rfind("\xff\xd9") == string_view::npos; }

bool IsBmp(string_view bytes) { return bytes.starts_with("BM"); }
std::optional<double> PixelsOfBmp(string_view bytes) {
  constexpr double kOldHeader = 12;  // OS/2's, with sizes of 16 bits.
  if (NumberAt(bytes, 14, 4, false) == kOldHeader) {
    return NumberAt(bytes, 18, 2, false) * NumberAt(bytes, 20, 2, false);
  }
  // Heights below zero stand for pictures from top to bottom.
  const double height = NumberAt(bytes, 22, 4, false);
  return NumberAt(bytes, 18, 4, false) * std::min(height, 4294967296.0 - height);
}

bool IsTiff(string_view bytes) {
  return bytes.starts_with(string_view("II*\0", 4)) || bytes.starts_with(string_view("MM\0*", 4));
}
// Of the first directory: a count, then entries of 12 bytes: tag, type (3: 16 bits, else 32), count, value.
std::optional<double> PixelsOfTiff(string_view bytes) {
  constexpr double kWidth = 256;
  constexpr double kHeight = 257;
  const bool is_big_endian = bytes[0] == 'M';
  const auto directory = static_cast<size_t>(NumberAt(bytes, 4, 4, is_big_endian));
  const auto num_entries = static_cast<size_t>(NumberAt(bytes, directory, 2, is_big_endian));
  double width = 0;
  double height = 0;
  for (size_t i = 0; i < num_entries; ++i) {
    const size_t entry = directory + 2 + 12 * i;
    const double tag = NumberAt(bytes, entry, 2, is_big_endian);
    const size_t size = NumberAt(bytes, entry + 2, 2, is_big_endian) == 3 ? 2 : 4;
    const double value = NumberAt(bytes, entry + 8, size, is_big_endian);
    if (tag == kWidth) width = value;
    if (tag == kHeight) height = value;
  }
  return width * height;
}

// Magic number, blank, then width and height in digits, among blanks and comments.
bool IsPnm(string_view bytes) {
  return bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
         string_view(" \t\r\n").find(bytes[2]) != string_view::npos;
}
std::optional<double> PixelsOfPnm(string_view bytes) {
  std::istringstream header(std::string(bytes.substr(2, 1000)));
  double sizes[2] = {0, 0};
  for (double& size : sizes) {
    while ((header >> std::ws).peek() == '#') header.ignore(1000, '\n');
    if (!(header >> size)) return std::nullopt;
  }
  return sizes[0] * sizes[1];
}

bool IsNeverCutShort(string_view /*bytes*/) { return false; }

struct Format {
  string_view name;
  bool (*matches)(string_view bytes);
  std::optional<double> (*num_pixels)(string_view bytes);
  bool (*is_cut_short)(string_view bytes);
};
constexpr Format kFormats[] = {
    {"PNG", &IsPng, &PixelsOfPng, &IsPngCutShort},       {"JPEG", &IsJpeg, &PixelsOfJpeg, &IsJpegCutShort},
    {"BMP", &IsBmp, &PixelsOfBmp, &IsNeverCutShort},     {"TIFF", &IsTiff, &PixelsOfTiff, &IsNeverCutShort},
    {"PGM/PPM", &IsPnm, &PixelsOfPnm, &IsNeverCutShort},
};

}  // namespace

std::optional<PictureHeader> ReadPictureHeader(string_view bytes) {
  for (const Format& format : kFormats) {
    if (!format.matches(bytes)) continue;
    return PictureHeader{format.name, format.num_pixels(bytes), format.is_cut_short(bytes)};
  }
  return std::nullopt;
}

string_view PictureFormatNames() { return "PNG, JPEG, BMP, TIFF, PGM/PPM"; }

}  // namespace heba
