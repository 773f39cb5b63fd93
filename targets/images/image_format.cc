#include "targets/images/image_format.h"

#include <algorithm>
#include <array>

namespace heba {
namespace {

using std::string_view;

struct Size {
  double width_px = 0;
  double height_px = 0;
};

// Reads an unsigned integer of `count` bytes; bytes beyond the end count as zero.
double NumberAt(string_view bytes, size_t at, size_t count, bool is_big_endian) {
  double value = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t k = at + (is_big_endian ? i : count - 1 - i);
    value = 256 * value + (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0);
  }
  return value;
}

bool IsPng(string_view bytes) { return bytes.starts_with(string_view("\x89PNG\r\n\x1a\n", 8)); }
Size SizeOfPng(string_view bytes) { return {NumberAt(bytes, 16, 4, true), NumberAt(bytes, 20, 4, true)}; }
// A PNG consists of chunks (length, type, data, checksum), and IEND is the last one.
bool IsPngCutShort(string_view bytes) {
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    if (bytes.substr(at + 4, 4) == "IEND") return false;
    at += 12 + static_cast<size_t>(NumberAt(bytes, at, 4, true));
  }
  return true;
}

bool IsJpeg(string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }
// A JPEG consists of segments: any number of bytes FF, a marker, a length. The marker of the frame is one of C0 to CF
// except C4, C8 and CC.
Size SizeOfJpeg(string_view bytes) {
  for (size_t at = 2; at + 9 < bytes.size() && bytes[at] == '\xff';) {
    if (bytes[at + 1] == '\xff') {
      ++at;
      continue;
    }
    const auto marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      return {NumberAt(bytes, at + 7, 2, true), NumberAt(bytes, at + 5, 2, true)};
    }
    at += 2 + static_cast<size_t>(NumberAt(bytes, at + 2, 2, true));
  }
  return {};
}
// Bytes that a camera or an editor added may follow the end marker.
bool IsJpegCutShort(string_view bytes) { return bytes.rfind("\xff\xd9") == string_view::npos; }

bool IsBmp(string_view bytes) { return bytes.starts_with("BM"); }
Size SizeOfBmp(string_view bytes) {
  constexpr double kOldHeader = 12;  // OS/2 header, with sizes of 16 bits.
  if (NumberAt(bytes, 14, 4, false) == kOldHeader) {
    return {NumberAt(bytes, 18, 2, false), NumberAt(bytes, 20, 2, false)};
  }
  // Negative heights mark images that are stored from top to bottom.
  const double height = NumberAt(bytes, 22, 4, false);
  return {NumberAt(bytes, 18, 4, false), std::min(height, 4294967296.0 - height)};
}

bool IsTiff(string_view bytes) {
  return bytes.starts_with(string_view("II*\0", 4)) || bytes.starts_with(string_view("MM\0*", 4));
}
// Reads the size from the first directory, which is a count followed by entries of 12 bytes: tag, type (1: 8 bits, 3:
// 16 bits, else 32 bits), count, value.
Size SizeOfTiff(string_view bytes) {
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
    const double type = NumberAt(bytes, entry + 2, 2, is_big_endian);
    const double value = NumberAt(bytes, entry + 8, type == 1 ? 1 : type == 3 ? 2 : 4, is_big_endian);
    // Decoders differ in the value they take from a repeated tag; the largest one is used here.
    if (tag == kWidth) width = std::max(width, value);
    if (tag == kHeight) height = std::max(height, value);
  }
  return {width, height};
}

// A PNM header consists of a magic number (P2, P3, P5 or P6), white space, and width and height in digits, separated
// by white space and comments.
bool IsPnm(string_view bytes) {
  return bytes.size() > 2 && bytes[0] == 'P' && string_view("2356").find(bytes[1]) != string_view::npos &&
         string_view(" \t\r\n").find(bytes[2]) != string_view::npos;
}
Size SizeOfPnm(string_view bytes) {
  std::array<double, 2> sizes{};
  size_t at = 2;
  for (double& size : sizes) {
    const auto is_digit = [&] { return at < bytes.size() && bytes[at] >= '0' && bytes[at] <= '9'; };
    for (; at < bytes.size() && !is_digit(); ++at) {
      if (bytes[at] == '#') at = std::min(bytes.find_first_of("\r\n", at), bytes.size());
    }
    for (; is_digit(); ++at) size = 10 * size + (bytes[at] - '0');
  }
  return {sizes[0], sizes[1]};
}

bool IsNeverCutShort(string_view /*bytes*/) { return false; }

struct Format {
  string_view name;
  bool (*matches)(string_view bytes);
  Size (*size)(string_view bytes);
  bool (*is_cut_short)(string_view bytes);
};
constexpr Format kFormats[] = {
    {"PNG", &IsPng, &SizeOfPng, &IsPngCutShort},       {"JPEG", &IsJpeg, &SizeOfJpeg, &IsJpegCutShort},
    {"BMP", &IsBmp, &SizeOfBmp, &IsNeverCutShort},     {"TIFF (not BigTIFF)", &IsTiff, &SizeOfTiff, &IsNeverCutShort},
    {"PGM/PPM", &IsPnm, &SizeOfPnm, &IsNeverCutShort},
};

}  // namespace

std::optional<ImageHeader> ReadImageHeader(string_view bytes) {
  for (const Format& format : kFormats) {
    if (!format.matches(bytes)) continue;
    const Size size = format.size(bytes);
    return ImageHeader{size.width_px, size.height_px, format.is_cut_short(bytes)};
  }
  return std::nullopt;
}

std::string ImageFormatNames() {
  std::string names;
  for (const Format& format : kFormats) names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

}  // namespace heba
