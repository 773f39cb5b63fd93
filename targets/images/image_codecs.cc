#include "targets/images/image_codecs.h"

#include <dlfcn.h>

#include <cstdio>
#include <mutex>
#include <stdexcept>
#include <type_traits>

#include <opencv2/imgcodecs.hpp>

namespace heba {
namespace {

using Decode = cv::Mat (*)(cv::InputArray, int);
using Encode = bool (*)(const cv::String&, cv::InputArray, std::vector<uchar>&, const std::vector<int>&);
struct Codecs {
  Decode decode;
  Encode encode;
};

#ifdef HEBA_IMAGE_CODECS

// The assertions check that OpenCV has such functions; the constants are their mangled names.
static_assert(std::is_same_v<Decode, decltype(static_cast<Decode>(&cv::imdecode))>);
static_assert(std::is_same_v<Encode, decltype(static_cast<Encode>(&cv::imencode))>);
constexpr const char* kDecodeSymbol = "_ZN2cv8imdecodeERKNS_11_InputArrayEi";
constexpr const char* kEncodeSymbol =
    "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKNS_11_InputArrayERSt6vectorIhSaIhEE"
    "RKSB_IiSaIiEE";

void* Found(void* address) {
  if (address != nullptr) return address;
  const char* const reason = dlerror();
  throw std::runtime_error(std::string("OpenCV's image library cannot be used (") + (reason != nullptr ? reason : "") +
                           "); install the OpenCV that heba was built with");
}

Codecs LoadCodecs() {
  void* const library = Found(dlopen(HEBA_IMAGE_CODECS, RTLD_LAZY | RTLD_LOCAL));
  return {reinterpret_cast<Decode>(Found(dlsym(library, kDecodeSymbol))),   // NOLINT
          reinterpret_cast<Encode>(Found(dlsym(library, kEncodeSymbol)))};  // NOLINT
}

#else

Codecs LoadCodecs() { return {&cv::imdecode, &cv::imencode}; }

#endif

const Codecs& LoadedCodecs() {
  static const Codecs codecs = LoadCodecs();
  return codecs;
}

std::vector<unsigned char> Encoded(const std::string& suffix, const cv::Mat& image, const std::vector<int>& options) {
  std::vector<unsigned char> bytes;
  if (!LoadedCodecs().encode(suffix, image, bytes, options)) bytes.clear();
  return bytes;
}

// Discards what C libraries write to `stderr` while an instance lives. The libraries for PNG and JPEG print warnings
// there, which do not concern the user or are reported again by the caller that decodes. heba's own messages use the
// C++ stream, which does not use the variable `stderr`.
class WithoutLibrariesWarnings {
 public:
  WithoutLibrariesWarnings() {
    const std::lock_guard<std::mutex> lock(Mutex());
    if (Count()++ > 0) return;
    static FILE* const nowhere = std::fopen("/dev/null", "w");
    if (nowhere == nullptr) return;
    Kept() = stderr;
    stderr = nowhere;
  }
  ~WithoutLibrariesWarnings() {
    const std::lock_guard<std::mutex> lock(Mutex());
    if (--Count() > 0 || Kept() == nullptr) return;
    stderr = Kept();
    Kept() = nullptr;
  }
  WithoutLibrariesWarnings(const WithoutLibrariesWarnings&) = delete;
  WithoutLibrariesWarnings& operator=(const WithoutLibrariesWarnings&) = delete;

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }
  static int& Count() {
    static int count = 0;
    return count;
  }
  static FILE*& Kept() {
    static FILE* kept = nullptr;
    return kept;
  }
};

}  // namespace

cv::Mat DecodeImage(const cv::Mat& bytes) {
  const WithoutLibrariesWarnings silence;
  return LoadedCodecs().decode(bytes, cv::IMREAD_UNCHANGED);
}

std::vector<unsigned char> EncodeImage(const std::string& suffix, const cv::Mat& image) {
  return Encoded(suffix, image, {});
}

std::vector<unsigned char> EncodeJpeg(const cv::Mat& image, int quality) {
  return Encoded(".jpg", image, {cv::IMWRITE_JPEG_QUALITY, quality});
}

}  // namespace heba
