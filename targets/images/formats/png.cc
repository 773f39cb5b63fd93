// PNG by libpng.
#include <csetjmp>
#include <cstring>
#include <new>
#include <string>
#include <utility>

#include <png.h>

#include "targets/images/formats/format.h"

namespace heba {
namespace {

using std::string_view;

bool IsPng(string_view bytes) { return bytes.starts_with(string_view("\x89PNG\r\n\x1a\n", 8)); }

// A PNG consists of chunks (length, type, data, checksum), and IEND is the last one.
bool IsCutShort(string_view bytes) {
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    if (bytes.substr(at + 4, 4) == "IEND") return false;
    at += size_t{12} + NumberAt(bytes, at, 4, true);
  }
  return true;
}

ImageHeader HeaderOf(string_view bytes) {
  return {static_cast<double>(NumberAt(bytes, 16, 4, true)), static_cast<double>(NumberAt(bytes, 20, 4, true)),
          IsCutShort(bytes)};
}

// The state of a reader or a writer, which libpng's functions leave by a jump if an error occurs.
struct Png {
  Png() = default;
  Png(const Png&) = delete;
  Png& operator=(const Png&) = delete;
  ~Png() {
    if (is_writer) png_destroy_write_struct(&png, &info);
    if (!is_writer) png_destroy_read_struct(&png, &info, nullptr);
  }

  // Runs a step, in which nothing with a destructor may be alive while libpng works. Returns false, with the error set,
  // if libpng left it.
  bool Allow(void (Png::*step)()) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;  // NOLINT(cert-err52-cpp)
    (this->*step)();
    return true;
  }
  void SetImage(const cv::Mat& new_image);
  void ReadInfo() { png_read_info(png, info); }
  void ReadPixels();
  void WriteAll();

  png_structp png = nullptr;
  png_infop info = nullptr;
  bool is_writer = false;
  std::string error;
  string_view unread;                  // Of a reader.
  std::vector<unsigned char> written;  // Of a writer.
  cv::Mat image;
  std::vector<png_bytep> rows;  // Of `image`.
};

void Fail(png_structp png, png_const_charp message) {
  static_cast<Png*>(png_get_error_ptr(png))->error = message;
  png_longjmp(png, 1);
}
void Ignore(png_structp /*png*/, png_const_charp /*warning*/) {}

void Png::SetImage(const cv::Mat& new_image) {
  image = new_image;
  for (int row = 0; row < image.rows; ++row) rows.push_back(image.ptr(row));
}

bool IsLittleEndian() {
  constexpr uint16_t kOne = 1;
  unsigned char first = 0;
  std::memcpy(&first, &kOne, 1);
  return first == 1;
}

void Read(png_structp png, png_bytep to, size_t count) {
  string_view& unread = static_cast<Png*>(png_get_io_ptr(png))->unread;
  if (count > unread.size()) png_error(png, "the file ends too early");
  std::memcpy(to, unread.data(), count);
  unread.remove_prefix(count);
}

void Png::ReadPixels() {
  const png_byte color_type = png_get_color_type(png, info);
  if (IsLittleEndian()) png_set_swap(png);
  if (image.channels() < 4) {
    png_set_strip_alpha(png);
  } else {
    png_set_tRNS_to_alpha(png);
  }
  if (color_type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  const bool is_grey = (color_type & PNG_COLOR_MASK_COLOR) == 0;
  if (is_grey && png_get_bit_depth(png, info) < 8) png_set_expand_gray_1_2_4_to_8(png);
  if (!is_grey) png_set_bgr(png);
  if (is_grey && image.channels() > 1) png_set_gray_to_rgb(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != image.cols * image.elemSize()) {
    png_error(png, "its header contradicts itself");
  }
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
}

// Returns the type of the image that ReadPixels fills.
int TypeOf(png_structp png, png_infop info) {
  png_bytep alphas = nullptr;
  int num_alphas = 0;
  png_color_16p colour = nullptr;
  png_get_tRNS(png, info, &alphas, &num_alphas, &colour);
  const png_byte color_type = png_get_color_type(png, info);
  const bool has_alpha =
      (color_type & PNG_COLOR_MASK_ALPHA) != 0 || ((color_type & PNG_COLOR_MASK_COLOR) != 0 && num_alphas > 0);
  const int channels = has_alpha ? 4 : (color_type & PNG_COLOR_MASK_COLOR) != 0 ? 3 : 1;
  return CV_MAKETYPE(png_get_bit_depth(png, info) == 16 ? CV_16U : CV_8U, channels);
}

Outcome<cv::Mat> Decode(string_view bytes) {
  Png state;
  state.unread = bytes;
  state.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &state, &Fail, &Ignore);
  if (state.png != nullptr) state.info = png_create_info_struct(state.png);
  if (state.info == nullptr) return Failure("libpng cannot be used");
  png_set_read_fn(state.png, &state, &Read);
  if (!state.Allow(&Png::ReadInfo)) return Unreadable("libpng", state.error);
  const Outcome<cv::Mat> image = NewImage(png_get_image_width(state.png, state.info),
                                          png_get_image_height(state.png, state.info), TypeOf(state.png, state.info));
  if (!image) return image;
  state.SetImage(*image);
  if (!state.Allow(&Png::ReadPixels)) return Unreadable("libpng", state.error);
  return state.image;
}

void Write(png_structp png, png_bytep from, size_t count) {
  std::vector<unsigned char>& written = static_cast<Png*>(png_get_io_ptr(png))->written;
  bool has_memory = true;
  try {
    written.insert(written.end(), from, from + count);
  } catch (const std::bad_alloc&) {
    has_memory = false;
  }
  if (!has_memory) png_error(png, "there is not enough memory for it");
}
void Flush(png_structp /*png*/) {}

// The filter, the level and the strategy are those of OpenCV: fast, and small for what is drawn.
void Png::WriteAll() {
  constexpr int kFastest = 1;
  constexpr int kRunLengths = 3;  // Z_RLE of zlib.
  const int channels = image.channels();
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png, kFastest);
  png_set_compression_strategy(png, kRunLengths);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.cols), static_cast<png_uint_32>(image.rows),
               image.depth() == CV_8U ? 8 : 16,
               channels == 1   ? PNG_COLOR_TYPE_GRAY
               : channels == 3 ? PNG_COLOR_TYPE_RGB
                               : PNG_COLOR_TYPE_RGB_ALPHA,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  png_set_bgr(png);
  if (IsLittleEndian()) png_set_swap(png);
  png_write_image(png, rows.data());
  png_write_end(png, info);
}

Outcome<std::vector<unsigned char>> Encode(const cv::Mat& image, int /*quality*/) {
  if (image.depth() != CV_8U && image.depth() != CV_16U) return WrongDepth();
  Png state;
  state.is_writer = true;
  state.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &state, &Fail, &Ignore);
  if (state.png != nullptr) state.info = png_create_info_struct(state.png);
  if (state.info == nullptr) return Failure("libpng cannot be used");
  png_set_write_fn(state.png, &state, &Write, &Flush);
  state.SetImage(image);
  if (!state.Allow(&Png::WriteAll)) return Failure("libpng: " + state.error);
  return std::move(state.written);
}

}  // namespace

const ImageFormat& Format_png();
const ImageFormat& Format_png() {
  static constexpr ImageFormat kFormat = {"PNG", &IsPng, &HeaderOf, &Decode, ".png", &Encode};
  return kFormat;
}

}  // namespace heba
