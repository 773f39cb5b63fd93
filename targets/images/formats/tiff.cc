// TIFF by libtiff: 16 bits per channel as they are, and whatever has fewer through libtiff's conversion to colours.
#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

#include <tiffio.h>

#include "targets/images/formats/format.h"

namespace heba {
namespace {

using std::string_view;

bool IsTiff(string_view bytes) {
  return bytes.starts_with(string_view("II*\0", 4)) || bytes.starts_with(string_view("MM\0*", 4));
}

// Reads the size from the first directory, which is a count followed by entries of 12 bytes: tag, type (1: 8 bits, 3:
// 16 bits, else 32 bits), count, value.
ImageHeader HeaderOf(string_view bytes) {
  const bool is_big_endian = bytes[0] == 'M';
  const size_t directory = NumberAt(bytes, 4, 4, is_big_endian);
  const size_t num_entries = NumberAt(bytes, directory, 2, is_big_endian);
  ImageHeader header;
  for (size_t i = 0; i < num_entries; ++i) {
    const size_t entry = directory + 2 + 12 * i;
    const uint32_t tag = NumberAt(bytes, entry, 2, is_big_endian);
    const uint32_t type = NumberAt(bytes, entry + 2, 2, is_big_endian);
    const double value = NumberAt(bytes, entry + 8, type == 1 ? 1 : type == 3 ? 2 : 4, is_big_endian);
    // Decoders differ in the value they take from a repeated tag; the largest one is used here.
    if (tag == TIFFTAG_IMAGEWIDTH) header.width_px = std::max(header.width_px, value);
    if (tag == TIFFTAG_IMAGELENGTH) header.height_px = std::max(header.height_px, value);
  }
  return header;
}

// No strip or tile, and no other block that libtiff allocates, is larger.
constexpr tmsize_t kMostBlockBytes = tmsize_t{1} << 30;

struct Close {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, Close>;

// The bytes as libtiff reads them, and the first error.
struct Source {
  // Opens the image, which reads from this place as long as it is open.
  Tiff Open();

  string_view bytes;
  uint64_t at = 0;
  std::string error;
};

Source* SourceOf(thandle_t handle) { return static_cast<Source*>(handle); }

tmsize_t Read(thandle_t handle, void* to, tmsize_t count) {
  Source* const source = SourceOf(handle);
  const uint64_t at = std::min<uint64_t>(source->at, source->bytes.size());
  const uint64_t num =
      std::min<uint64_t>(static_cast<uint64_t>(std::max<tmsize_t>(count, 0)), source->bytes.size() - at);
  std::memcpy(to, source->bytes.data() + at, num);
  source->at = at + num;
  return static_cast<tmsize_t>(num);
}
tmsize_t RefuseToWrite(thandle_t /*handle*/, void* /*from*/, tmsize_t /*count*/) { return 0; }
toff_t Seek(thandle_t handle, toff_t offset, int whence) {
  Source* const source = SourceOf(handle);
  source->at = offset + (whence == SEEK_CUR ? source->at : whence == SEEK_END ? source->bytes.size() : 0);
  return source->at;
}
int KeepOpen(thandle_t /*handle*/) { return 0; }
toff_t SizeOf(thandle_t handle) { return SourceOf(handle)->bytes.size(); }

[[gnu::format(printf, 4, 0)]] int KeepError(TIFF* /*tiff*/, void* data, const char* /*module*/, const char* format,
                                            va_list arguments) {
  char message[200] = {};
  std::vsnprintf(message, sizeof message, format, arguments);
  auto* const source = static_cast<Source*>(data);
  if (source->error.empty()) source->error = message;
  return 1;  // The handlers of the whole process are not called.
}
int IgnoreWarning(TIFF* /*tiff*/, void* /*data*/, const char* /*module*/, const char* /*format*/, va_list /*list*/) {
  return 1;
}

Tiff Source::Open() {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             &TIFFOpenOptionsFree);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMostBlockBytes);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &KeepError, this);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &IgnoreWarning, nullptr);
  return Tiff(TIFFClientOpenExt("image", "rm", this, &Read, &RefuseToWrite, &Seek, &KeepOpen, &SizeOf, nullptr, nullptr,
                                options.get()));
}

struct Layout {
  uint32_t width = 0;
  uint32_t height = 0;
  uint16_t photometric = 0;
  uint16_t bits = 1;
  uint16_t samples = 1;
  uint16_t sample_format = SAMPLEFORMAT_UINT;
  uint16_t planes = PLANARCONFIG_CONTIG;
  bool is_tiled = false;
  uint32_t block_width = 0;  // Of strips or tiles.
  uint32_t block_height = 0;

  bool is_grey() const { return photometric == PHOTOMETRIC_MINISWHITE || photometric == PHOTOMETRIC_MINISBLACK; }
  // Whether the values are taken as they are.
  bool is_deep() const {
    return bits > 8 && photometric <= PHOTOMETRIC_RGB && (samples == 1 || samples == 3 || samples == 4);
  }
};

Layout LayoutOf(TIFF* tiff) {
  Layout layout;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &layout.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &layout.height);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &layout.photometric);
  TIFFGetField(tiff, TIFFTAG_BITSPERSAMPLE, &layout.bits);
  if (TIFFGetField(tiff, TIFFTAG_SAMPLESPERPIXEL, &layout.samples) == 0) layout.samples = layout.is_grey() ? 1 : 3;
  TIFFGetField(tiff, TIFFTAG_SAMPLEFORMAT, &layout.sample_format);
  TIFFGetField(tiff, TIFFTAG_PLANARCONFIG, &layout.planes);
  layout.is_tiled = TIFFIsTiled(tiff) != 0;
  TIFFGetField(tiff, layout.is_tiled ? TIFFTAG_TILEWIDTH : TIFFTAG_IMAGEWIDTH, &layout.block_width);
  TIFFGetField(tiff, layout.is_tiled ? TIFFTAG_TILELENGTH : TIFFTAG_ROWSPERSTRIP, &layout.block_height);
  if (layout.block_height == 0 || !layout.is_tiled) {
    layout.block_height = layout.block_height == 0 ? layout.height : std::min(layout.block_height, layout.height);
  }
  return layout;
}

// Returns the type of the image, or why heba does not read it.
Outcome<int> TypeOf(const Layout& layout) {
  if (layout.samples > 4) return Failure("it has more than 4 channels");
  if (layout.is_deep()) {
    const bool is_known = layout.bits == 10 || layout.bits == 12 || layout.bits == 14 || layout.bits == 16;
    if (!is_known || layout.sample_format == SAMPLEFORMAT_IEEEFP) return WrongDepth();
    if (layout.planes == PLANARCONFIG_SEPARATE && layout.samples > 1) {
      return Failure("its channels are stored one after the other; convert it to PNG");
    }
    if (layout.is_grey() != (layout.samples == 1)) return Failure("its header contradicts itself");
    return CV_16UC(layout.samples);
  }
  const bool is_palette = layout.photometric == PHOTOMETRIC_PALETTE;
  const bool is_known = layout.bits == 1 || layout.bits == 8 || layout.bits == 16;
  if (!is_known || layout.photometric == PHOTOMETRIC_LOGLUV) return WrongDepth();
  if (layout.is_grey()) return CV_8UC1;
  if (is_palette && layout.bits > 1) return CV_8UC3;
  if (layout.samples == 2) return Failure("it has 2 channels; a grey or colour image is needed");
  return CV_8UC(layout.samples);
}

// Sets a row of an image from colours of libtiff.
void SetRow(const uint32_t* colours, int count, int channels, uchar* row) {
  for (int i = 0; i < count; ++i, row += channels) {
    const uint32_t colour = colours[i];
    if (channels == 1) {
      row[0] = static_cast<uchar>(BrightnessOf(TIFFGetB(colour), TIFFGetG(colour), TIFFGetR(colour)));
      continue;
    }
    row[0] = static_cast<uchar>(TIFFGetB(colour));
    row[1] = static_cast<uchar>(TIFFGetG(colour));
    row[2] = static_cast<uchar>(TIFFGetR(colour));
    if (channels == 4) row[3] = static_cast<uchar>(TIFFGetA(colour));
  }
}

// Sets a row of an image from values of `bits` bits. Those of 10 to 14 bits are packed, and become the upper bits.
void SetDeepRow(const uchar* packed, uint32_t bits, int count, int channels, uint16_t* row) {
  for (int i = 0; i < count * channels; ++i) {
    uint32_t value = 0;
    if (bits == 16) {
      uint16_t whole = 0;
      std::memcpy(&whole, packed + 2 * static_cast<size_t>(i), 2);
      value = whole;
    } else {
      const size_t first = static_cast<size_t>(i) * bits;
      for (size_t bit = first; bit < first + bits; ++bit) value = 2 * value + (packed[bit / 8] >> (7 - bit % 8) & 1U);
      value <<= 16 - bits;
    }
    const int channel = i % channels;
    row[channels >= 3 && channel < 3 ? i - channel + 2 - channel : i] = static_cast<uint16_t>(value);
  }
}

// A strip or a tile, and what of it lies in the image.
struct Block {
  uint32_t index = 0;
  uint32_t x = 0;
  uint32_t y = 0;
  int width = 0;
  int height = 0;
};

// Reads the pixels of an image. The functions return false if libtiff does not read a block.
class PixelReader {
 public:
  PixelReader(TIFF* tiff, const Layout& layout, const cv::Mat& image) : tiff_(tiff), layout_(layout), image_(image) {}

  bool ReadAll();

 private:
  bool ReadColours(const Block& block);
  bool ReadDeep(const Block& block);

  TIFF* tiff_;
  const Layout& layout_;
  cv::Mat image_;
  // These buffers hold the pixels of one block.
  std::vector<uint32_t> colours_;
  std::vector<uchar> packed_;
};

// libtiff's rows begin with the lowest one.
bool PixelReader::ReadColours(const Block& block) {
  colours_.resize(static_cast<size_t>(layout_.block_width) * layout_.block_height);
  constexpr int kStopAtErrors = 1;
  const int is_read = layout_.is_tiled ? TIFFReadRGBATileExt(tiff_, block.x, block.y, colours_.data(), kStopAtErrors)
                                       : TIFFReadRGBAStripExt(tiff_, block.y, colours_.data(), kStopAtErrors);
  if (is_read == 0) return false;
  const size_t rows = layout_.is_tiled ? layout_.block_height : static_cast<size_t>(block.height);
  for (int i = 0; i < block.height; ++i) {
    const uint32_t* const row = colours_.data() + (rows - 1 - static_cast<size_t>(i)) * layout_.block_width;
    SetRow(row, block.width, image_.channels(),
           image_.ptr(static_cast<int>(block.y) + i) + static_cast<size_t>(block.x) * image_.elemSize());
  }
  return true;
}

bool PixelReader::ReadDeep(const Block& block) {
  const size_t pitch = (static_cast<size_t>(layout_.block_width) * layout_.samples * layout_.bits + 7) / 8;
  packed_.resize(pitch * layout_.block_height);
  const auto size = static_cast<tmsize_t>(packed_.size());
  const tmsize_t num_read = layout_.is_tiled ? TIFFReadEncodedTile(tiff_, block.index, packed_.data(), size)
                                             : TIFFReadEncodedStrip(tiff_, block.index, packed_.data(), size);
  if (num_read < static_cast<tmsize_t>(pitch * static_cast<size_t>(block.height))) return false;
  for (int i = 0; i < block.height; ++i) {
    SetDeepRow(packed_.data() + static_cast<size_t>(i) * pitch, layout_.bits, block.width, image_.channels(),
               image_.ptr<uint16_t>(static_cast<int>(block.y) + i) +
                   static_cast<size_t>(block.x) * static_cast<size_t>(image_.channels()));
  }
  return true;
}

bool PixelReader::ReadAll() {
  Block block;
  for (uint32_t y = 0; y < layout_.height; y += layout_.block_height) {
    for (uint32_t x = 0; x < layout_.width; x += layout_.block_width, ++block.index) {
      block.x = x;
      block.y = y;
      block.width = static_cast<int>(std::min(layout_.block_width, layout_.width - x));
      block.height = static_cast<int>(std::min(layout_.block_height, layout_.height - y));
      const bool is_read = image_.depth() == CV_16U ? ReadDeep(block) : ReadColours(block);
      if (!is_read) return false;
    }
  }
  return true;
}

Outcome<cv::Mat> Decode(string_view bytes) {
  Source source;
  source.bytes = bytes;
  const Tiff tiff = source.Open();
  if (tiff == nullptr) return Unreadable("libtiff", source.error);
  const Layout layout = LayoutOf(tiff.get());
  const Outcome<int> type = TypeOf(layout);
  if (!type) return type.failure();
  const Outcome<cv::Mat> image = NewImage(layout.width, layout.height, *type);
  if (!image) return image;
  const uint64_t bytes_per_pixel = layout.is_deep() ? sizeof(uint16_t) * layout.samples : sizeof(uint32_t);
  const uint64_t block_bytes = bytes_per_pixel * layout.block_width * layout.block_height;
  if (layout.block_width == 0 || block_bytes >= uint64_t{kMostBlockBytes}) {
    return Failure("its tiles have no size, or one above the limit of heba; convert it to PNG");
  }
  // Pixels are as stored, whatever the orientation that the metadata tell.
  TIFFSetField(tiff.get(), TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  if (!PixelReader(tiff.get(), layout, *image).ReadAll()) {
    return source.error.empty() ? CutShort() : Unreadable("libtiff", source.error);
  }
  return image;
}

}  // namespace

const ImageFormat& Format_tiff();
const ImageFormat& Format_tiff() {
  static constexpr ImageFormat kFormat = {"TIFF", &IsTiff, &HeaderOf, &Decode, "", nullptr};
  return kFormat;
}

}  // namespace heba
