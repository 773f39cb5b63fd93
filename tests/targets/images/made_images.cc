#include "tests/targets/images/made_images.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include <jpeglib.h>
#include <png.h>
#include <tiffio.h>

namespace heba {
namespace {

// Odd sizes: no row ends with a byte, and no block or tile with the image.
constexpr int kWidth = 61;
constexpr int kHeight = 37;

// Returns value `channel` of a pixel, between 0 and 1: ramps with an edge, and a little texture.
double ValueAt(int row, int column, int channel) {
  const double wave = 0.5 + 0.5 * std::sin(0.21 * column * (1 + channel) + 0.13 * row * row / 7.0 + channel);
  const double ramp = static_cast<double>(row + column) / (kWidth + kHeight);
  const double texture = ((row * 31 + column * 17 + channel * 7) % 11) / 11.0;
  const double value = 0.5 * wave + 0.35 * ramp + 0.15 * texture;
  return row > kHeight / 2 && column > kWidth / 3 && column < kWidth / 2 ? 1 - value : value;
}

// Returns the packed rows of an image, the upper bits of a byte first and 16 bits as this machine stores them.
std::vector<std::vector<unsigned char>> PackedRows(int channels, int bits, int width, int height) {
  std::vector<std::vector<unsigned char>> rows;
  for (int row = 0; row < height; ++row) {
    std::vector<unsigned char> bytes((static_cast<size_t>(width) * channels * bits + 7) / 8);
    for (int i = 0; i < width * channels; ++i) {
      const auto value =
          static_cast<uint32_t>(std::lround(ValueAt(row, i / channels, i % channels) * ((1 << bits) - 1)));
      if (bits == 16) {
        const auto whole = static_cast<uint16_t>(value);
        std::copy_n(reinterpret_cast<const unsigned char*>(&whole), 2, &bytes[2 * static_cast<size_t>(i)]);
        continue;
      }
      for (int bit = 0; bit < bits; ++bit) {
        const size_t at = static_cast<size_t>(i) * bits + bit;
        if ((value >> (bits - 1 - bit) & 1) != 0) bytes[at / 8] |= static_cast<unsigned char>(0x80 >> at % 8);
      }
    }
    rows.push_back(bytes);
  }
  return rows;
}

struct PngKind {
  int color_type = PNG_COLOR_TYPE_GRAY;
  int bits = 8;
  bool is_interlaced = false;
  bool has_transparent_colour = false;
  bool is_palette_grey = false;
};

std::string Png(const PngKind& kind) {
  std::string written;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &written,
      [](png_structp writer, png_bytep from, size_t count) {
        static_cast<std::string*>(png_get_io_ptr(writer))->append(reinterpret_cast<const char*>(from), count);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, kWidth, kHeight, kind.bits, kind.color_type,
               kind.is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (kind.color_type == PNG_COLOR_TYPE_PALETTE) {
    std::vector<png_color> palette;
    for (int i = 0; i < 1 << kind.bits; ++i) {
      const auto shade = static_cast<png_byte>(255 - 11 * i);
      palette.push_back(kind.is_palette_grey
                            ? png_color{shade, shade, shade}
                            : png_color{shade, static_cast<png_byte>(37 * i), static_cast<png_byte>(90 + i)});
    }
    png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
  }
  if (kind.has_transparent_colour) {
    std::array<png_byte, 2> alphas = {10, 200};
    png_color_16 colour = {};
    colour.gray = colour.red = colour.green = colour.blue = 1;
    png_set_tRNS(png, info, alphas.data(), static_cast<int>(alphas.size()), &colour);
  }
  png_write_info(png, info);
  const int channels = png_get_channels(png, info);
  if (kind.bits == 16) png_set_swap(png);
  std::vector<std::vector<unsigned char>> rows = PackedRows(channels, kind.bits, kWidth, kHeight);
  std::vector<png_bytep> pointers;
  for (std::vector<unsigned char>& row : rows) pointers.push_back(row.data());
  png_write_image(png, pointers.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return written;
}

struct JpegKind {
  J_COLOR_SPACE from = JCS_RGB;
  J_COLOR_SPACE stored = JCS_YCbCr;
  int channels = 3;
  int horizontal = 1;  // Sampling of the brightness, relative to that of the colours.
  int vertical = 1;
  int quality = 85;
  bool is_progressive = false;
  bool is_arithmetic = false;
  unsigned restart_interval = 0;
  bool has_orientation = false;
  bool has_tables = true;
};

std::string Jpeg(const JpegKind& kind) {
  jpeg_compress_struct jpeg = {};
  jpeg_error_mgr errors = {};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int)
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = kWidth;
  jpeg.image_height = kHeight;
  jpeg.input_components = kind.channels;
  jpeg.in_color_space = kind.from;
  jpeg_set_defaults(&jpeg);
  jpeg_set_colorspace(&jpeg, kind.stored);
  jpeg_set_quality(&jpeg, kind.quality, TRUE);
  jpeg.comp_info[0].h_samp_factor = kind.horizontal;
  jpeg.comp_info[0].v_samp_factor = kind.vertical;
  for (int i = 1; i < jpeg.num_components; ++i) jpeg.comp_info[i].h_samp_factor = jpeg.comp_info[i].v_samp_factor = 1;
  if (kind.stored == JCS_YCCK) {
    jpeg.comp_info[3].h_samp_factor = kind.horizontal;
    jpeg.comp_info[3].v_samp_factor = kind.vertical;
  }
  if (kind.is_progressive) jpeg_simple_progression(&jpeg);
  jpeg.arith_code = kind.is_arithmetic ? TRUE : FALSE;
  jpeg.restart_interval = kind.restart_interval;
  if (!kind.has_tables) jpeg_suppress_tables(&jpeg, TRUE);
  jpeg_start_compress(&jpeg, kind.has_tables ? TRUE : FALSE);
  if (kind.has_orientation) {
    // A quarter turn.
    const std::string exif("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0", 32);
    jpeg_write_marker(&jpeg, JPEG_APP0 + 1, reinterpret_cast<const JOCTET*>(exif.data()),
                      static_cast<unsigned>(exif.size()));
  }
  std::vector<std::vector<unsigned char>> rows = PackedRows(kind.channels, 8, kWidth, kHeight);
  for (std::vector<unsigned char>& row : rows) {
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&jpeg, &pointer, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::string written(reinterpret_cast<const char*>(bytes), size);
  std::free(bytes);
  return written;
}

// Puts the tables of quantisation, without those of Huffman, into a JPEG that was written without any.
std::string FrameOfFilm() {
  JpegKind kind;
  const std::string whole = Jpeg(kind);
  std::string frame;
  for (size_t at = 2; at + 4 < whole.size();) {
    const auto marker = static_cast<unsigned char>(whole[at + 1]);
    const size_t length =
        2 + 256 * static_cast<unsigned char>(whole[at + 2]) + static_cast<unsigned char>(whole[at + 3]);
    if (marker == 0xda) return whole.substr(0, 2) + frame + whole.substr(at);
    if (marker != 0xc4) frame += whole.substr(at, length);
    at += length;
  }
  return whole;
}

struct TiffKind {
  uint16_t photometric = PHOTOMETRIC_MINISBLACK;
  uint16_t samples = 1;
  uint16_t bits = 8;
  uint16_t compression = COMPRESSION_NONE;
  uint32_t rows_per_strip = 8;
  uint32_t tile = 0;  // The side of a tile; 0 for strips.
  uint16_t orientation = 0;
  uint16_t alpha = EXTRASAMPLE_UNASSALPHA;
  uint16_t predictor = 0;
  bool is_big_endian = false;
  bool has_planes = false;
};

std::string Tiff(const TiffKind& kind) {
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("heba_made_" + std::to_string(getpid()) + ".tiff");
  TIFF* const tiff = TIFFOpen(path.c_str(), kind.is_big_endian ? "wb" : "wl");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, kWidth);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, kHeight);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.photometric);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.samples);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, kind.has_planes ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
  if (kind.compression == COMPRESSION_JPEG) TIFFSetField(tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
  if (kind.orientation != 0) TIFFSetField(tiff, TIFFTAG_ORIENTATION, kind.orientation);
  if (kind.predictor != 0) TIFFSetField(tiff, TIFFTAG_PREDICTOR, kind.predictor);
  if (kind.samples == 2 || (kind.samples == 4 && kind.photometric != PHOTOMETRIC_SEPARATED)) {
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &kind.alpha);
  }
  if (kind.photometric == PHOTOMETRIC_PALETTE) {
    std::vector<uint16_t> red;
    std::vector<uint16_t> green;
    std::vector<uint16_t> blue;
    for (int i = 0; i < 1 << kind.bits; ++i) {
      red.push_back(static_cast<uint16_t>(257 * i));
      green.push_back(static_cast<uint16_t>(65535 - 200 * i));
      blue.push_back(static_cast<uint16_t>(31 * i * i));
    }
    TIFFSetField(tiff, TIFFTAG_COLORMAP, red.data(), green.data(), blue.data());
  }
  const int channels = kind.has_planes ? 1 : kind.samples;
  const int planes = kind.has_planes ? kind.samples : 1;
  if (kind.tile != 0) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kind.tile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, kind.tile);
    const int side = static_cast<int>(kind.tile);
    const int across = (kWidth + side - 1) / side;
    const int down = (kHeight + side - 1) / side;
    // The tiles hold parts of one picture that is as large as all of them.
    const std::vector<std::vector<unsigned char>> rows = PackedRows(channels, kind.bits, across * side, down * side);
    const size_t pitch = static_cast<size_t>(side) * channels * kind.bits / 8;
    for (int i = 0; i < across * down * planes; ++i) {
      std::vector<unsigned char> tile;
      for (int row = 0; row < side; ++row) {
        const auto& whole = rows[static_cast<size_t>(i / across % down * side + row)];
        const auto begin = whole.begin() + static_cast<std::ptrdiff_t>(pitch) * (i % across);
        tile.insert(tile.end(), begin, begin + static_cast<std::ptrdiff_t>(pitch));
      }
      TIFFWriteEncodedTile(tiff, static_cast<uint32_t>(i), tile.data(), static_cast<tmsize_t>(tile.size()));
    }
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, kind.rows_per_strip);
    std::vector<std::vector<unsigned char>> rows = PackedRows(channels, kind.bits, kWidth, kHeight);
    for (uint16_t plane = 0; plane < planes; ++plane) {
      for (uint32_t row = 0; row < kHeight; ++row) {
        // libtiff may change what it is given.
        std::vector<unsigned char> line = rows[plane % 2 == 0 ? row : kHeight - 1 - row];
        TIFFWriteScanline(tiff, line.data(), row, plane);
      }
    }
  }
  TIFFClose(tiff);
  std::ifstream stream(path, std::ios::binary);
  std::string written{std::istreambuf_iterator<char>(stream), {}};
  std::filesystem::remove(path);
  return written;
}

std::string Little(uint32_t value, int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> 8 * i & 255);
  return bytes;
}

struct BmpKind {
  uint32_t bits = 24;
  uint32_t compression = 0;
  uint32_t header = 40;
  bool is_from_top = false;
  bool is_grey = false;
  std::vector<uint32_t> masks = {};
  uint32_t num_colours = 0;  // 0: as many as the bits allow.
};

std::string BmpPalette(const BmpKind& kind) {
  std::string palette;
  if (kind.bits > 8) return palette;
  const uint32_t count = kind.num_colours == 0 ? 1U << kind.bits : kind.num_colours;
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t step = 255 / ((1U << kind.bits) - 1);
    palette += Little(255 - step * i, 1) + Little(kind.is_grey ? 255 - step * i : 37 * i, 1) +
               Little(kind.is_grey ? 255 - step * i : 128 + i, 1) + (kind.header == 12 ? "" : std::string(1, '\0'));
  }
  return palette;
}

std::string BmpOf(const BmpKind& kind, const std::string& pixels) {
  std::string header = Little(kind.header, 4);
  if (kind.header == 12) {
    header += Little(kWidth, 2) + Little(kHeight, 2) + Little(1, 2) + Little(kind.bits, 2);
  } else {
    header += Little(kWidth, 4) + Little(kind.is_from_top ? 0U - kHeight : kHeight, 4) + Little(1, 2) +
              Little(kind.bits, 2) + Little(kind.compression, 4) + Little(0, 4) + Little(2835, 4) + Little(2835, 4) +
              Little(kind.num_colours, 4) + Little(0, 4);
  }
  for (const uint32_t mask : kind.masks) header += Little(mask, 4);
  header.resize(std::max<size_t>(header.size(), kind.header), '\0');
  header += BmpPalette(kind);
  const auto offset = static_cast<uint32_t>(14 + header.size());
  return "BM" + Little(static_cast<uint32_t>(offset + pixels.size()), 4) + Little(0, 4) + Little(offset, 4) + header +
         pixels;
}

std::string Bmp(const BmpKind& kind) {
  std::string pixels;
  const int channels = kind.bits == 24 ? 3 : kind.bits == 32 ? 4 : 1;
  for (const std::vector<unsigned char>& row :
       PackedRows(channels, static_cast<int>(kind.bits) / channels, kWidth, kHeight)) {
    pixels.append(row.begin(), row.end());
    pixels.resize((pixels.size() + 3) / 4 * 4, '\0');
  }
  return BmpOf(kind, pixels);
}

// Runs of equal pixels (8 bits) or of two in turn (4 bits), pixels one by one, a row that ends early and, with 8 bits,
// a part that is left out.
std::string BmpOfRuns(BmpKind kind) {
  kind.compression = kind.bits == 8 ? 1 : 2;
  std::string pixels;
  for (int row = 0; row < kHeight; ++row) {
    int column = 0;
    if (row % 5 == 3) {
      pixels += Little(0, 1) + Little(7, 1);  // Seven pixels one by one.
      for (uint32_t i = 0; i < (kind.bits == 8 ? 7U : 4U); ++i)
        pixels += Little(13 * i + static_cast<uint32_t>(row), 1);
      if (kind.bits == 8) pixels += '\0';
      column = 7;
    }
    const bool ends_early = row % 7 == 2;
    const int end = ends_early ? kWidth / 2 : kWidth;
    while (column < end) {
      const int count = std::min(end - column, 1 + (row * 7 + column) % 23);
      pixels += Little(static_cast<uint32_t>(count), 1) + Little(static_cast<uint32_t>(row * 5 + column * 3), 1);
      column += count;
    }
    if (kind.bits == 8 && row == 20) {
      pixels += Little(0, 2) + Little(0, 1) + Little(2, 1) + Little(3, 1) + Little(2, 1);  // Three right, two up.
      row += 2;
    }
    pixels += Little(0, 2);
  }
  pixels += Little(0, 1) + Little(1, 1);
  return BmpOf(kind, pixels);
}

std::string Pnm(int kind, int largest) {
  std::string bytes = "P" + std::to_string(kind) + "\n# made\n" + std::to_string(kWidth) + " # wide\n  " +
                      std::to_string(kHeight) + "\n";
  const bool is_bits = kind == 1 || kind == 4;
  if (!is_bits) bytes += std::to_string(largest) + "\n";
  const int channels = kind == 3 || kind == 6 ? 3 : 1;
  if (kind == 4) {
    for (const std::vector<unsigned char>& row : PackedRows(1, 1, kWidth, kHeight))
      bytes.append(row.begin(), row.end());
    return bytes;
  }
  for (int row = 0; row < kHeight; ++row) {
    for (int i = 0; i < kWidth * channels; ++i) {
      const auto value =
          static_cast<int>(std::lround(ValueAt(row, i / channels, i % channels) * (is_bits ? 1 : largest)));
      if (kind <= 3) {
        bytes += std::to_string(value) + (i % 10 == 9 ? "\n" : is_bits && i % 2 == 0 ? "" : " ");
      } else if (largest > 255) {
        bytes += Little(static_cast<uint32_t>(value) >> 8, 1) + Little(static_cast<uint32_t>(value) & 255, 1);
      } else {
        bytes += Little(static_cast<uint32_t>(value), 1);
      }
    }
    bytes += kind <= 3 ? "\n" : "";
  }
  return bytes;
}

}  // namespace

std::vector<MadeImage> MadePngs() {
  std::vector<MadeImage> images;
  const auto add = [&](const std::string& name, int color_type, const std::vector<int>& depths) {
    for (const int bits : depths) {
      for (int variant = 0; variant < 8; ++variant) {
        PngKind kind{color_type, bits, (variant & 1) != 0, (variant & 2) != 0, (variant & 4) != 0};
        if (kind.is_palette_grey && color_type != PNG_COLOR_TYPE_PALETTE) continue;
        if (kind.has_transparent_colour && (color_type & PNG_COLOR_MASK_ALPHA) != 0) continue;
        images.push_back(
            {"png " + name + " " + std::to_string(bits) + " bits, variant " + std::to_string(variant), Png(kind)});
      }
    }
  };
  add("grey", PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16});
  add("colour", PNG_COLOR_TYPE_RGB, {8, 16});
  add("palette", PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8});
  add("grey with alpha", PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16});
  add("colour with alpha", PNG_COLOR_TYPE_RGB_ALPHA, {8, 16});
  return images;
}

std::vector<MadeImage> MadeJpegs() {
  std::vector<MadeImage> images;
  for (const bool is_progressive : {false, true}) {
    const std::string name = is_progressive ? "progressive jpeg " : "jpeg ";
    const auto add = [&](const std::string& what, JpegKind kind) {
      kind.is_progressive = is_progressive;
      images.push_back({name + what, Jpeg(kind)});
    };
    add("grey", {JCS_GRAYSCALE, JCS_GRAYSCALE, 1});
    for (const int quality : {10, 60, 95, 100})
      add("colour " + std::to_string(quality), {JCS_RGB, JCS_YCbCr, 3, 2, 2, quality});
    for (const int horizontal : {1, 2, 4}) {
      for (const int vertical : {1, 2}) {
        add("colour " + std::to_string(horizontal) + std::to_string(vertical),
            {JCS_RGB, JCS_YCbCr, 3, horizontal, vertical});
      }
    }
    add("red, green, blue", {JCS_RGB, JCS_RGB, 3});
    add("inks", {JCS_CMYK, JCS_CMYK, 4});
    add("inks by brightness", {JCS_CMYK, JCS_YCCK, 4});
    add("inks by brightness, halved", {JCS_CMYK, JCS_YCCK, 4, 2, 2});
    JpegKind restarts;
    restarts.restart_interval = 3;
    add("restarts", restarts);
    JpegKind turned;
    turned.has_orientation = true;
    add("turned", turned);
    JpegKind arithmetic;
    arithmetic.is_arithmetic = true;
    add("arithmetic", arithmetic);
  }
  images.push_back({"jpeg without tables", FrameOfFilm()});
  return images;
}

std::vector<MadeImage> MadeTiffs() {
  std::vector<MadeImage> images;
  const std::vector<std::pair<std::string, uint16_t>> compressions = {{"plain", COMPRESSION_NONE},
                                                                      {"lzw", COMPRESSION_LZW},
                                                                      {"deflate", COMPRESSION_ADOBE_DEFLATE},
                                                                      {"packbits", COMPRESSION_PACKBITS}};
  const auto add = [&](const std::string& what, TiffKind kind) {
    for (const auto& [name, compression] : compressions) {
      for (const uint32_t tile : {0, 16, 32}) {
        // libtiff writes, uncompressed, no smaller tiles.
        constexpr uint32_t kLeastBits = 8 * 1024;
        if (compression == COMPRESSION_NONE && tile != 0 && tile * tile * kind.samples * kind.bits < kLeastBits)
          continue;
        kind.compression = compression;
        kind.tile = tile;
        kind.rows_per_strip = compression == COMPRESSION_LZW ? 1000 : 8;
        kind.is_big_endian = compression == COMPRESSION_PACKBITS;
        kind.predictor = compression == COMPRESSION_ADOBE_DEFLATE && kind.bits >= 8 && kind.bits % 8 == 0 ? 2 : 0;
        images.push_back(
            {"tiff " + what + " " + std::to_string(kind.bits) + " bits " + name + " tile " + std::to_string(tile),
             Tiff(kind)});
      }
    }
  };
  for (const uint16_t bits : {1, 8, 10, 12, 14, 16}) {
    add("grey", {PHOTOMETRIC_MINISBLACK, 1, bits});
    add("inverse grey", {PHOTOMETRIC_MINISWHITE, 1, bits});
  }
  for (const uint16_t bits : {8, 10, 12, 14, 16}) {
    add("colour", {PHOTOMETRIC_RGB, 3, bits});
    add("colour with alpha", {PHOTOMETRIC_RGB, 4, bits});
  }
  TiffKind associated{PHOTOMETRIC_RGB, 4, 8};
  associated.alpha = EXTRASAMPLE_ASSOCALPHA;
  add("colour with associated alpha", associated);
  add("grey with alpha", {PHOTOMETRIC_MINISBLACK, 2, 8});
  add("grey with alpha", {PHOTOMETRIC_MINISBLACK, 2, 16});
  add("palette", {PHOTOMETRIC_PALETTE, 1, 8});
  add("inks", {PHOTOMETRIC_SEPARATED, 4, 8});
  TiffKind planes{PHOTOMETRIC_RGB, 3, 8};
  planes.has_planes = true;
  planes.rows_per_strip = 8;
  add("planes", planes);
  TiffKind jpeg{PHOTOMETRIC_YCBCR, 3, 8, COMPRESSION_JPEG, 16};
  images.push_back({"tiff of jpeg", Tiff(jpeg)});
  jpeg.photometric = PHOTOMETRIC_RGB;
  images.push_back({"tiff of jpeg in red, green, blue", Tiff(jpeg)});
  images.push_back({"tiff of a fax", Tiff({PHOTOMETRIC_MINISWHITE, 1, 1, COMPRESSION_CCITTFAX4})});
  return images;
}

std::vector<MadeImage> TurnedTiffs() {
  std::vector<MadeImage> images;
  for (const uint16_t bits : {8, 16}) {
    for (const uint32_t tile : {0, 32}) {
      for (uint16_t orientation = 1; orientation <= 8; ++orientation) {
        TiffKind kind{PHOTOMETRIC_RGB, 3, bits};
        kind.tile = tile;
        kind.orientation = orientation;
        images.push_back({"tiff " + std::to_string(bits) + " bits tile " + std::to_string(tile) + " orientation " +
                              std::to_string(orientation),
                          Tiff(kind)});
      }
    }
  }
  return images;
}

std::vector<MadeImage> MadeBmps() {
  std::vector<MadeImage> images;
  for (const bool is_from_top : {false, true}) {
    for (const bool is_grey : {false, true}) {
      const std::string name = std::string("bmp ") + (is_from_top ? "from the top " : "") + (is_grey ? "grey " : "");
      for (const uint32_t bits : {1, 4, 8}) {
        images.push_back({name + std::to_string(bits), Bmp({bits, 0, 40, is_from_top, is_grey})});
        images.push_back({name + "v4 " + std::to_string(bits), Bmp({bits, 0, 108, is_from_top, is_grey})});
      }
      images.push_back({name + "runs of 8", BmpOfRuns({8, 1, 40, is_from_top, is_grey})});
      images.push_back({name + "runs of 4", BmpOfRuns({4, 2, 40, is_from_top, is_grey})});
      BmpKind few{8, 0, 40, is_from_top, is_grey};
      few.num_colours = 100;
      images.push_back({name + "100 colours", Bmp(few)});
    }
    const std::string name = std::string("bmp ") + (is_from_top ? "from the top " : "");
    for (const uint32_t bits : {16, 24, 32}) {
      images.push_back({name + std::to_string(bits), Bmp({bits, 0, 40, is_from_top})});
      images.push_back({name + "v5 " + std::to_string(bits), Bmp({bits, 0, 124, is_from_top})});
    }
    images.push_back({name + "masks of 5 bits", Bmp({16, 3, 40, is_from_top, false, {0x7c00, 0x3e0, 0x1f}})});
    images.push_back({name + "masks of 6 bits", Bmp({16, 3, 40, is_from_top, false, {0xf800, 0x7e0, 0x1f}})});
    images.push_back({name + "masks of 32", Bmp({32, 3, 40, is_from_top, false, {0xff0000, 0xff00, 0xff}})});
    const std::vector<std::vector<uint32_t>> masks = {
        {0xff0000, 0xff00, 0xff, 0xff000000}, {0xff, 0xff00, 0xff0000, 0xff000000},
        {0xff000000, 0xff0000, 0xff00, 0xff}, {0xff0000, 0xff00, 0xff, 0},
        {0x7c00, 0x3e0, 0x1f, 0xf0000000},    {0x3ff00000, 0xffc00, 0x3ff, 0xc0000000},
        {0, 0xff00, 0xff, 0xff000000}};
    for (size_t i = 0; i < masks.size(); ++i) {
      const bool has_other_bits = std::any_of(masks[i].begin(), masks[i].end(),
                                              [](uint32_t mask) { return mask != 0 && std::popcount(mask) != 8; });
      for (const uint32_t header : {40, 52, 56, 108, 124}) {
        images.push_back({name + std::to_string(header) + " masks of 32, " + std::to_string(i),
                          Bmp({32, 3, header, is_from_top, false, masks[i]}), has_other_bits});
      }
    }
  }
  for (const uint32_t bits : {1, 4, 8, 24, 32}) {
    images.push_back({"old bmp " + std::to_string(bits), Bmp({bits, 0, 12})});
    images.push_back({"old grey bmp " + std::to_string(bits), Bmp({bits, 0, 12, false, true})});
  }
  return images;
}

std::vector<MadeImage> MadePnms() {
  std::vector<MadeImage> images;
  for (int kind = 1; kind <= 6; ++kind) {
    for (const int largest : {1, 15, 100, 255, 256, 4095, 65535}) {
      if ((kind == 1 || kind == 4) && largest != 1) continue;
      images.push_back({"P" + std::to_string(kind) + " " + std::to_string(largest), Pnm(kind, largest)});
    }
  }
  return images;
}

}  // namespace heba
