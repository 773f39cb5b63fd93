// JPEG by libjpeg-turbo.
#include <csetjmp>
#include <cstdio>
#include <new>
#include <string>
#include <utility>

#include <jpeglib.h>

#include <jerror.h>

#include "targets/images/formats/format.h"

namespace heba {
namespace {

using std::string_view;

bool IsJpeg(string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }

// A JPEG consists of segments: any number of bytes FF, a marker, a length. The marker of the frame is one of C0 to CF
// except C4, C8 and CC. Bytes that a camera or an editor added may follow the end marker.
ImageHeader HeaderOf(string_view bytes) {
  ImageHeader header;
  header.is_cut_short = bytes.rfind("\xff\xd9") == string_view::npos;
  for (size_t at = 2; at + 9 < bytes.size() && bytes[at] == '\xff';) {
    if (bytes[at + 1] == '\xff') {
      ++at;
      continue;
    }
    const auto marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      header.width_px = NumberAt(bytes, at + 7, 2, true);
      header.height_px = NumberAt(bytes, at + 5, 2, true);
      break;
    }
    at += size_t{2} + NumberAt(bytes, at + 2, 2, true);
  }
  return header;
}

// The handler of errors, which leaves libjpeg's functions by a jump.
struct DecoderErrors {
  DecoderErrors();

  // Runs a step, in which nothing with a destructor may be alive while libjpeg works. Returns false, with the error
  // set, if libjpeg left it.
  template <class Step>
  bool Allow(const Step& step) {
    if (setjmp(place) != 0) return false;  // NOLINT(cert-err52-cpp)
    step();
    return true;
  }

  jpeg_error_mgr base = {};  // The first member: libjpeg knows the handler by its address.
  std::jmp_buf place = {};
  std::string error;
};

DecoderErrors* ErrorsOf(j_common_ptr jpeg) { return reinterpret_cast<DecoderErrors*>(jpeg->err); }  // NOLINT

void Leave(j_common_ptr jpeg) {
  DecoderErrors* const errors = ErrorsOf(jpeg);
  if (errors->error.empty()) {
    char message[JMSG_LENGTH_MAX] = {};
    errors->base.format_message(jpeg, message);
    errors->error = message;
  }
  std::longjmp(errors->place, 1);  // NOLINT(cert-err52-cpp)
}

// At its end, libjpeg would complete a file that is truncated with grey. Damage that it repairs is not reported.
void OnMessage(j_common_ptr jpeg, int /*level*/) {
  if (jpeg->err->msg_code != JWRN_JPEG_EOF) return;
  ErrorsOf(jpeg)->error = "the file ends too early";
  Leave(jpeg);
}
void Ignore(j_common_ptr /*jpeg*/) {}

DecoderErrors::DecoderErrors() {
  jpeg_std_error(&base);
  base.error_exit = &Leave;
  base.emit_message = &OnMessage;
  base.output_message = &Ignore;
}

struct Reader {
  Reader() { jpeg.err = &errors.base; }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() { jpeg_destroy_decompress(&jpeg); }

  void ReadHeader();
  void ReadPixels();

  DecoderErrors errors;
  jpeg_decompress_struct jpeg = {};
  string_view bytes;
  cv::Mat image;
  std::vector<unsigned char> inks;  // A row of an image in cyan, magenta, yellow and black.
};

void Reader::ReadHeader() {
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());  // NOLINT
  jpeg_read_header(&jpeg, TRUE);
}

// The inks are stored inverted, as most programs do.
void SetColours(const std::vector<unsigned char>& inks, uchar* row) {
  for (size_t i = 0; i < inks.size() / 4; ++i) {
    const int black = inks[4 * i + 3];
    for (size_t k = 0; k < 3; ++k) {
      row[3 * i + 2 - k] = static_cast<uchar>(black - ((255 - inks[4 * i + k]) * black >> 8));
    }
  }
}

void Reader::ReadPixels() {
  const bool has_inks = !inks.empty();
  jpeg.out_color_space = has_inks ? JCS_CMYK : image.channels() == 3 ? JCS_EXT_BGR : JCS_GRAYSCALE;
  jpeg_start_decompress(&jpeg);
  for (int i = 0; i < image.rows; ++i) {
    JSAMPROW row = has_inks ? inks.data() : image.ptr(i);
    jpeg_read_scanlines(&jpeg, &row, 1);
    if (has_inks) SetColours(inks, image.ptr(i));
  }
}

Outcome<cv::Mat> Decode(string_view bytes) {
  Reader reader;
  reader.bytes = bytes;
  if (!reader.errors.Allow([&] { reader.ReadHeader(); })) return Unreadable("libjpeg", reader.errors.error);
  const int components = reader.jpeg.num_components;
  const Outcome<cv::Mat> image =
      NewImage(reader.jpeg.image_width, reader.jpeg.image_height, components > 1 ? CV_8UC3 : CV_8UC1);
  if (!image) return image;
  reader.image = *image;
  if (components == 4) reader.inks.resize(4 * static_cast<size_t>(reader.image.cols));
  if (!reader.errors.Allow([&] { reader.ReadPixels(); })) return Unreadable("libjpeg", reader.errors.error);
  return reader.image;
}

// A writer with the place where libjpeg puts what it has written, a block at a time.
struct Writer {
  Writer() { jpeg.err = &errors.base; }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer() { jpeg_destroy_compress(&jpeg); }

  void WriteAll();

  DecoderErrors errors;
  jpeg_compress_struct jpeg = {};
  jpeg_destination_mgr destination = {};
  std::vector<unsigned char> block = std::vector<unsigned char>(size_t{1} << 14);
  std::vector<unsigned char> written;
  cv::Mat image;
  int quality = 0;
};

Writer* WriterOf(j_compress_ptr jpeg) { return static_cast<Writer*>(jpeg->client_data); }

void StartBlock(j_compress_ptr jpeg) {
  jpeg->dest->next_output_byte = WriterOf(jpeg)->block.data();
  jpeg->dest->free_in_buffer = WriterOf(jpeg)->block.size();
}

void KeepBlock(j_compress_ptr jpeg, size_t count) {
  Writer* const writer = WriterOf(jpeg);
  try {
    writer->written.insert(writer->written.end(), writer->block.data(), writer->block.data() + count);
    return;
  } catch (const std::bad_alloc&) {
    // The writer is left below, outside of the handler.
  }
  ERREXIT1(jpeg, JERR_OUT_OF_MEMORY, 0);
}

boolean EndBlock(j_compress_ptr jpeg) {
  KeepBlock(jpeg, WriterOf(jpeg)->block.size());
  StartBlock(jpeg);
  return TRUE;
}

void EndLastBlock(j_compress_ptr jpeg) { KeepBlock(jpeg, WriterOf(jpeg)->block.size() - jpeg->dest->free_in_buffer); }

void Writer::WriteAll() {
  jpeg_create_compress(&jpeg);
  jpeg.client_data = this;
  destination.init_destination = &StartBlock;
  destination.empty_output_buffer = &EndBlock;
  destination.term_destination = &EndLastBlock;
  jpeg.dest = &destination;
  const int channels = image.channels();
  jpeg.image_width = static_cast<JDIMENSION>(image.cols);
  jpeg.image_height = static_cast<JDIMENSION>(image.rows);
  jpeg.input_components = channels;
  jpeg.in_color_space = channels == 1 ? JCS_GRAYSCALE : channels == 3 ? JCS_EXT_BGR : JCS_EXT_BGRX;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, TRUE);
  jpeg_start_compress(&jpeg, TRUE);
  for (int i = 0; i < image.rows; ++i) {
    JSAMPROW row = image.ptr(i);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
}

Outcome<std::vector<unsigned char>> Encode(const cv::Mat& image, int quality) {
  if (image.depth() != CV_8U) return Failure("it has not 8 bits per channel, which JPEG needs");
  Writer writer;
  writer.image = image;
  writer.quality = quality;
  if (!writer.errors.Allow([&] { writer.WriteAll(); })) return Failure("libjpeg: " + writer.errors.error);
  return std::move(writer.written);
}

}  // namespace

const ImageFormat& Format_jpeg();
const ImageFormat& Format_jpeg() {
  static constexpr ImageFormat kFormat = {"JPEG", &IsJpeg, &HeaderOf, &Decode, ".jpg", &Encode};
  return kFormat;
}

}  // namespace heba
