// BMP: 1, 4 and 8 bits with a palette, also compressed by run lengths, and 16, 24 and 32 bits.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <optional>

#include "targets/images/formats/format.h"

namespace heba {
namespace {

using std::string_view;

struct Colour {
  uchar blue = 0;
  uchar green = 0;
  uchar red = 0;
};

// How the pixels are compressed; masks are no compression, but tell which bits are which colour.
constexpr uint32_t kNone = 0;
constexpr uint32_t kRuns8 = 1;
constexpr uint32_t kRuns4 = 2;
constexpr uint32_t kMasks = 3;

// Masks state the bits of each colour in 16 or 32.
struct Masks {
  bool has_wide_green = false;  // 16 bits: 6 of them are green, not 5.
  // 32 bits: those of red, green, blue and alpha. If one of the first three has none, the bytes are blue, green, red
  // and alpha.
  std::array<uint32_t, 4> bits{};
};
using Palette = std::array<Colour, 256>;

struct Layout {
  int64_t width = 0;
  int64_t height = 0;
  bool is_from_top = false;
  uint32_t bits = 0;  // Per pixel.
  uint32_t compression = kNone;
  size_t pixels_at = 0;
  int channels = 3;
  Palette palette{};
  Masks masks;
};

constexpr size_t kFileHeader = 14;
constexpr uint32_t kMostHeader = 0x7fffffff;
constexpr uint32_t kOldHeader = 12;  // OS/2 header, with sizes of 16 bits. Its images become grey, as in OpenCV.

bool IsBmp(string_view bytes) { return bytes.starts_with("BM"); }

uint32_t Number(string_view bytes, size_t at, size_t count) { return NumberAt(bytes, at, count, false); }

ImageHeader HeaderOf(string_view bytes) {
  if (Number(bytes, kFileHeader, 4) == kOldHeader) {
    return {static_cast<double>(Number(bytes, 18, 2)), static_cast<double>(Number(bytes, 20, 2))};
  }
  // Negative heights mark images that are stored from top to bottom.
  const double height = Number(bytes, 22, 4);
  return {static_cast<double>(Number(bytes, 18, 4)), std::min(height, 4294967296.0 - height)};
}

bool IsGrey(const Colour& colour) { return colour.blue == colour.green && colour.blue == colour.red; }

// Returns nothing if masks of 16 bits are not the two usual ones.
std::optional<Masks> ReadMasks(string_view bytes, uint32_t bits) {
  constexpr size_t kMasksAt = 54;
  constexpr uint32_t kHeaderWithMasks = 56;
  std::array<uint32_t, 4> masks{};
  for (size_t i = 0; i < masks.size(); ++i) masks[i] = Number(bytes, kMasksAt + 4 * i, 4);
  if (bits == 32) {
    // As in OpenCV, masks behind a shorter header say nothing.
    return Number(bytes, kFileHeader, 4) >= kHeaderWithMasks ? Masks{false, masks} : Masks();
  }
  if (masks[0] == 0xf800 && masks[1] == 0x7e0 && masks[2] == 0x1f) return Masks{true, {}};
  if (masks[0] == 0x7c00 && masks[1] == 0x3e0 && masks[2] == 0x1f) return Masks();
  return std::nullopt;
}

// Reads the palette, which follows the header. Returns nothing if it is too long.
std::optional<Palette> ReadPalette(string_view bytes, uint32_t bits) {
  const size_t header = Number(bytes, kFileHeader, 4);
  const bool is_old = header == kOldHeader;
  const size_t num_colours = size_t{1} << bits;
  const size_t num_used = is_old ? 0 : Number(bytes, 46, 4);
  const size_t num_stored = num_used == 0 ? num_colours : num_used;
  const size_t entry_size = is_old ? 3 : 4;
  const size_t palette_at = kFileHeader + header;
  Palette palette{};
  if (num_stored > palette.size() || palette_at + num_stored * entry_size > bytes.size()) return std::nullopt;
  for (size_t i = 0; i < num_stored; ++i) {
    const size_t entry = palette_at + i * entry_size;
    palette[i] = {static_cast<uchar>(Number(bytes, entry, 1)), static_cast<uchar>(Number(bytes, entry + 1, 1)),
                  static_cast<uchar>(Number(bytes, entry + 2, 1))};
  }
  return palette;
}

// Returns nothing if the header is one that is not read.
std::optional<Layout> ReadLayout(string_view bytes) {
  Layout layout;
  layout.pixels_at = Number(bytes, 10, 4);
  const uint32_t header = Number(bytes, kFileHeader, 4);
  const bool is_old = header == kOldHeader;
  if (!is_old && (header < 36 || header > kMostHeader)) return std::nullopt;
  layout.width = Number(bytes, 18, is_old ? 2 : 4);
  layout.height = static_cast<int32_t>(Number(bytes, is_old ? 20 : 22, is_old ? 2 : 4));
  layout.is_from_top = layout.height < 0;
  layout.height = std::abs(layout.height);
  layout.bits = Number(bytes, is_old ? 24 : 28, 2);
  layout.compression = is_old ? kNone : Number(bytes, 30, 4);
  const uint32_t bits = layout.bits;
  const bool has_palette = bits == 1 || bits == 4 || bits == 8;
  bool is_known = false;
  if (layout.compression == kNone) is_known = has_palette || bits == 24 || bits == 32 || (bits == 16 && !is_old);
  if (layout.compression == kRuns8) is_known = bits == 8;
  if (layout.compression == kRuns4) is_known = bits == 4;
  if (layout.compression == kMasks && (bits == 16 || bits == 32)) {
    const std::optional<Masks> masks = ReadMasks(bytes, bits);
    is_known = masks.has_value();
    layout.masks = masks.value_or(Masks());
  }
  if (!is_known) return std::nullopt;
  if (is_old) layout.channels = 1;
  // Without masks, the fourth byte of a pixel says nothing.
  if (bits == 32 && layout.compression == kMasks) layout.channels = 4;
  if (!has_palette) return layout;
  const std::optional<Palette> palette = ReadPalette(bytes, bits);
  if (!palette) return std::nullopt;
  layout.palette = *palette;
  // An image with grey colours only has one channel.
  if (std::all_of(palette->begin(), palette->begin() + (1 << bits), &IsGrey)) layout.channels = 1;
  return layout;
}

// Where the pixels of an image are written to, in the order in which the file has the rows.
class Canvas {
 public:
  Canvas(const Layout& layout, const cv::Mat& image) : layout_(layout), image_(image) {}

  void DrawRow(const uchar* data, int64_t row);
  // Draws an image of run lengths: pairs of a count and a colour (two colours in turn with 4 bits), or a zero and what
  // to do: 0 ends the row, 1 the image, 2 moves by the two following bytes, and a larger number is that of the pixels
  // that follow. Pixels that are skipped have the first colour. A full row goes on in the next one. Returns false if
  // the file ends before the image, or if a run leaves its row.
  bool DrawRuns(string_view bytes);

 private:
  void Set(int64_t row, int64_t column, const Colour& colour) {
    uchar* const line = Row(row);
    if (layout_.channels == 1) {
      line[column] = static_cast<uchar>(BrightnessOf(colour.blue, colour.green, colour.red));
      return;
    }
    uchar* const pixel = line + 3 * column;
    pixel[0] = colour.blue;
    pixel[1] = colour.green;
    pixel[2] = colour.red;
  }
  uchar* Row(int64_t row) { return image_.ptr(static_cast<int>(layout_.is_from_top ? row : layout_.height - 1 - row)); }

  const Layout& layout_;
  cv::Mat image_;
};

uint32_t IndexAt(const uchar* data, size_t i, uint32_t bits) {
  const size_t per_byte = 8 / bits;
  const auto shift = static_cast<uint32_t>((per_byte - 1 - i % per_byte) * bits);
  return (data[i / per_byte] >> shift) & ((1U << bits) - 1);
}

Colour WideColour(uint32_t value, bool has_wide_green) {
  if (has_wide_green) {
    return {static_cast<uchar>(value << 3), static_cast<uchar>((value >> 3) & 0xfc),
            static_cast<uchar>((value >> 8) & 0xf8)};
  }
  return {static_cast<uchar>(value << 3), static_cast<uchar>((value >> 2) & 0xf8),
          static_cast<uchar>((value >> 7) & 0xf8)};
}

// Returns the lowest 8 of the bits that a mask selects.
uchar Masked(uint32_t value, uint32_t mask) { return static_cast<uchar>((value & mask) >> std::countr_zero(mask)); }

// Returns a pixel with alpha from its four bytes.
cv::Vec4b MaskedPixel(const uchar* data, const std::array<uint32_t, 4>& masks) {
  if (masks[0] == 0 || masks[1] == 0 || masks[2] == 0) return cv::Vec4b(data);
  const uint32_t value = data[0] | data[1] << 8U | data[2] << 16U | uint32_t{data[3]} << 24U;
  return {Masked(value, masks[2]), Masked(value, masks[1]), Masked(value, masks[0]),
          masks[3] == 0 ? uchar{255} : Masked(value, masks[3])};
}

void Canvas::DrawRow(const uchar* data, int64_t row) {
  if (layout_.bits == 24 && layout_.channels == 3) {
    std::copy_n(data, 3 * layout_.width, Row(row));
    return;
  }
  for (int64_t column = 0; column < layout_.width; ++column) {
    const auto i = static_cast<size_t>(column);
    switch (layout_.bits) {
      case 16: {
        const uint32_t value = data[2 * i] + 256U * data[2 * i + 1];
        Set(row, column, WideColour(value, layout_.masks.has_wide_green));
        break;
      }
      case 24:
        Set(row, column, {data[3 * i], data[3 * i + 1], data[3 * i + 2]});
        break;
      case 32:
        if (layout_.channels < 4) Set(row, column, {data[4 * i], data[4 * i + 1], data[4 * i + 2]});
        if (layout_.channels == 4) std::copy_n(MaskedPixel(data + 4 * i, layout_.masks.bits).val, 4, Row(row) + 4 * i);
        break;
      default:
        Set(row, column, layout_.palette[IndexAt(data, i, layout_.bits)]);
    }
  }
}

bool Canvas::DrawRuns(string_view bytes) {
  const auto* const data = reinterpret_cast<const uchar*>(bytes.data());  // NOLINT
  for (int64_t row = 0; row < layout_.height; ++row) {
    for (int64_t column = 0; column < layout_.width; ++column) Set(row, column, layout_.palette[0]);
  }
  int64_t row = 0;
  int64_t column = 0;
  const auto draw = [&](size_t count, const uchar* indices, size_t period) {
    if (column == layout_.width) {
      column = 0;
      ++row;
    }
    if (row >= layout_.height || static_cast<int64_t>(count) > layout_.width - column) return false;
    for (size_t i = 0; i < count; ++i, ++column) {
      Set(row, column, layout_.palette[IndexAt(indices, i % period, layout_.bits)]);
    }
    return true;
  };
  size_t at = layout_.pixels_at;
  while (row < layout_.height - 1 || (row == layout_.height - 1 && column < layout_.width)) {
    if (at + 2 > bytes.size()) return false;
    const size_t count = data[at];
    const size_t code = data[at + 1];
    at += 2;
    if (count > 0) {
      if (!draw(count, data + at - 1, 8 / layout_.bits)) return false;
    } else if (code == 0) {
      column = 0;
      ++row;
    } else if (code == 1) {
      return true;
    } else if (code == 2) {
      if (at + 2 > bytes.size()) return false;
      column = std::min(column + data[at], layout_.width);
      row += data[at + 1];
      at += 2;
    } else {
      const size_t num_bytes = (code * layout_.bits + 7) / 8;
      const size_t padded = (num_bytes + 1) / 2 * 2;
      if (at + padded > bytes.size() || !draw(code, data + at, code)) return false;
      at += padded;
    }
  }
  return true;
}

Outcome<cv::Mat> Decode(string_view bytes) {
  const std::optional<Layout> layout = ReadLayout(bytes);
  if (!layout) return Failure("heba does not read this kind of BMP; convert it to PNG");
  const bool has_runs = layout->compression == kRuns8 || layout->compression == kRuns4;
  const uint64_t pitch = (static_cast<uint64_t>(layout->width) * layout->bits + 31) / 32 * 4;
  const Outcome<cv::Mat> image = NewImage(layout->width, layout->height, CV_8UC(layout->channels));
  if (!image) return image;
  if (layout->pixels_at + (has_runs ? 0 : pitch * static_cast<uint64_t>(layout->height)) > bytes.size()) {
    return CutShort();
  }
  Canvas canvas(*layout, *image);
  if (has_runs) {
    if (!canvas.DrawRuns(bytes)) return Failure("its runs of pixels are damaged, or it is truncated");
    return image;
  }
  for (int64_t row = 0; row < layout->height; ++row) {
    const size_t at = layout->pixels_at + static_cast<uint64_t>(row) * pitch;
    canvas.DrawRow(reinterpret_cast<const uchar*>(bytes.data()) + at, row);  // NOLINT
  }
  return image;
}

}  // namespace

const ImageFormat& Format_bmp();
const ImageFormat& Format_bmp() {
  static constexpr ImageFormat kFormat = {"BMP", &IsBmp, &HeaderOf, &Decode, "", nullptr};
  return kFormat;
}

}  // namespace heba
