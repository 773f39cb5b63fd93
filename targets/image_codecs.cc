#include "targets/image_codecs.h"

#include <dlfcn.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/error.h"

namespace heba {
namespace {

// Functions of OpenCV's, and the names that the compiler gives them.
using Decode = cv::Mat (*)(cv::InputArray, int);
using Encode = bool (*)(const cv::String&, cv::InputArray, std::vector<uchar>&, const std::vector<int>&);
static_assert(sizeof(static_cast<Decode>(&cv::imdecode)) > 0 && sizeof(static_cast<Encode>(&cv::imencode)) > 0);
constexpr const char* kDecodeSymbol = "_ZN2cv8imdecodeERKNS_11_InputArrayEi";
constexpr const char* kEncodeSymbol =
    "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKNS_11_InputArrayERSt6vectorIhSaIhEE"
    "RKSB_IiSaIiEE";

struct Codecs {
  Decode decode;
  Encode encode;
};

void* Found(void* address) {
  if (address == nullptr) throw InputError(std::string("OpenCV's library for pictures cannot be used: ") + dlerror());
  return address;
}

const Codecs& LoadedCodecs() {
  static const Codecs codecs = [] {
    void* const library = Found(dlopen(HEBA_IMAGE_CODECS, RTLD_LAZY | RTLD_LOCAL));
    return Codecs{reinterpret_cast<Decode>(Found(dlsym(library, kDecodeSymbol))),   // NOLINT
                  reinterpret_cast<Encode>(Found(dlsym(library, kEncodeSymbol)))};  // NOLINT
  }();
  return codecs;
}

std::vector<unsigned char> Encoded(const std::string& suffix, const cv::Mat& image, const std::vector<int>& options) {
  std::vector<unsigned char> bytes;
  if (!LoadedCodecs().encode(suffix, image, bytes, options)) bytes.clear();
  return bytes;
}

}  // namespace

cv::Mat DecodeImage(const cv::Mat& bytes) { return LoadedCodecs().decode(bytes, cv::IMREAD_UNCHANGED); }

std::vector<unsigned char> EncodeImage(const std::string& suffix, const cv::Mat& image) {
  return Encoded(suffix, image, {});
}

std::vector<unsigned char> EncodeJpeg(const cv::Mat& image, int quality) {
  return Encoded(".jpg", image, {cv::IMWRITE_JPEG_QUALITY, quality});
}

}  // namespace heba
