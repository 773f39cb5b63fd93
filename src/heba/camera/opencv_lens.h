// The relation of the usual lenses to OpenCV's: answers for CameraModel::ToOpenCv and FromOpenCv.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "heba/camera/camera_model.h"

namespace heba {

// A lens whose coefficients are the first kNum of OpenCV's k1 k2 p1 p2 k3 k4 k5 k6. It holds any lens of this kind
// whose other coefficients are 0.
template <int kNum>
struct OpenCvPolynomial {
  static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) {
    return OpenCvLens{LensKind::kPerspective, distortion};
  }
  static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) {
    if (lens.kind != LensKind::kPerspective) return std::nullopt;
    std::vector<double> distortion = lens.coefficients;
    if (std::any_of(distortion.begin() + std::min<std::ptrdiff_t>(kNum, std::ssize(distortion)), distortion.end(),
                    [](double coefficient) { return coefficient != 0; })) {
      return std::nullopt;
    }
    distortion.resize(kNum, 0.0);
    return distortion;
  }
};

// A lens whose coefficients are those of OpenCV's module fisheye.
struct OpenCvFisheye {
  static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) {
    return OpenCvLens{LensKind::kFisheye, distortion};
  }
  static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) {
    return lens.kind == LensKind::kFisheye ? std::optional<std::vector<double>>(lens.coefficients) : std::nullopt;
  }
};

}  // namespace heba
