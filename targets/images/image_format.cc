#include "targets/images/image_format.h"

#include <algorithm>
#include <array>

namespace heba {

using std::string_view;

#define HEBA_IMAGE_FORMAT(format) const ImageFormat& Format_##format();
#include "targets/images/formats.def"
#undef HEBA_IMAGE_FORMAT

namespace {

const auto& Formats() {
  static const auto formats = std::to_array<const ImageFormat*>({
#define HEBA_IMAGE_FORMAT(format) &Format_##format(),
#include "targets/images/formats.def"
#undef HEBA_IMAGE_FORMAT
  });
  return formats;
}

// A format that is known by its bytes `mark` at `offset`, and not read.
struct UnreadFormat {
  string_view name;
  size_t offset;
  string_view mark;
};
constexpr UnreadFormat kUnreadFormats[] = {
    {"a WebP", 8, "WEBP"},
    {"an OpenEXR", 0, "\x76\x2f\x31\x01"},
    {"a JPEG 2000", 0, string_view("\0\0\0\x0cjP  ", 8)},
    {"a JPEG 2000", 0, "\xff\x4f\xff\x51"},
    {"a GIF", 0, "GIF8"},
    {"a Radiance HDR", 0, "#?RADIANCE"},
    {"a Radiance HDR", 0, "#?RGBE"},
    {"a BigTIFF", 0, string_view("II+\0", 4)},
    {"a BigTIFF", 0, string_view("MM\0+", 4)},
    {"a PFM", 0, "PF\n"},
    {"a PFM", 0, "Pf\n"},
    {"a PAM", 0, "P7\n"},
    {"a Sun raster", 0, "\x59\xa6\x6a\x95"},
    {"an AVIF", 4, "ftypavi"},
    {"a HEIC", 4, "ftyphei"},
    {"a HEIC", 4, "ftypmif1"},
    {"a JPEG XL", 0, string_view("\0\0\0\x0cJXL ", 8)},
    {"a JPEG XL", 0, "\xff\x0a"},
    {"a Photoshop", 0, "8BPS"},
    {"a DICOM", 128, "DICM"},
};

}  // namespace

const ImageFormat* FormatOf(string_view bytes) {
  const auto found = std::find_if(Formats().begin(), Formats().end(),
                                  [&](const ImageFormat* format) { return format->matches(bytes); });
  return found == Formats().end() ? nullptr : *found;
}

const ImageFormat* FormatOfSuffix(string_view suffix) {
  const auto found = std::find_if(Formats().begin(), Formats().end(), [&](const ImageFormat* format) {
    return !suffix.empty() && format->suffix == suffix;
  });
  return found == Formats().end() ? nullptr : *found;
}

std::optional<ImageHeader> ReadImageHeader(string_view bytes) {
  const ImageFormat* const format = FormatOf(bytes);
  if (format == nullptr) return std::nullopt;
  return format->header(bytes);
}

std::string ImageFormatNames() {
  std::string names;
  for (const ImageFormat* format : Formats()) names += (names.empty() ? "" : ", ") + std::string(format->name);
  return names;
}

string_view UnreadFormatName(string_view bytes) {
  for (const UnreadFormat& format : kUnreadFormats) {
    if (bytes.size() > format.offset && bytes.substr(format.offset).starts_with(format.mark)) return format.name;
  }
  return {};
}

}  // namespace heba
