// Common parts of the models that divide x and y by a function of the point: the unified models, which project to
// spheres first.
#pragma once

#include <cmath>

#include "heba/camera/batched_camera_model.h"
#include "heba/camera/opencv_lens.h"

namespace heba {

// A lens that is the pinhole model if its kNum coefficients are 0, and no lens of OpenCV otherwise.
template <int kNum>
struct PinholeIfAllAreZero {
  static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) {
    return OpenCvPolynomial<0>::FromOpenCv({LensKind::kPerspective, distortion})
               ? std::optional<OpenCvLens>(OpenCvLens())
               : std::nullopt;
  }
  static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) {
    if (!OpenCvPolynomial<0>::FromOpenCv(lens)) return std::nullopt;
    return std::vector<double>(kNum, 0.0);
  }
};

template <class V>
HEBA_INLINE V RootOf(const V& value) {
  return EachLane<V>(value, value, [](double a, double) { return std::sqrt(a); });
}

// Returns the cosine of the largest angle between the optical axis and the rays that the unified model with `alpha`
// projects, negated: w1 of Usenko, Demmel and Cremers 2018.
inline double LargestCosine(double alpha) { return alpha <= 0.5 ? alpha / (1 - alpha) : (1 - alpha) / alpha; }

// D of x' = x / D, y' = y / D, a function of rho^2 = x^2 + y^2 and z.
template <class V>
struct ProjectionDivisor {
  V value;
  V by_rho;  // The derivative by rho, divided by rho.
  V by_z;
};

// Projects the point and sets its derivatives by the point. A point without an image is not finite.
template <class V, class Visible, int kNumDistortion>
HEBA_INLINE void ProjectBy(const ProjectionDivisor<V>& divisor, const Visible& is_visible, const V& x, const V& y,
                           DistortedImage<V, kNumDistortion>* image) {
  const V none = AllLanes<V>(std::numeric_limits<double>::quiet_NaN());
  const V inverse = is_visible ? ReciprocalOrNaN<V>(divisor.value) : none;
  image->x = x * inverse;
  image->y = y * inverse;
  // d (x / D) = (dx - x' dD) / D.
  const V x_by_divisor = -image->x * inverse;
  const V y_by_divisor = -image->y * inverse;
  image->x_by_point[0] = inverse + x_by_divisor * (divisor.by_rho * x);
  image->x_by_point[1] = x_by_divisor * (divisor.by_rho * y);
  image->x_by_point[2] = x_by_divisor * divisor.by_z;
  image->y_by_point[0] = y_by_divisor * (divisor.by_rho * x);
  image->y_by_point[1] = inverse + y_by_divisor * (divisor.by_rho * y);
  image->y_by_point[2] = y_by_divisor * divisor.by_z;
  // The derivatives by D; SetByCoefficient multiplies them.
  for (int k = 0; k < kNumDistortion; ++k) {
    image->x_by_distortion[k] = x_by_divisor;
    image->y_by_distortion[k] = y_by_divisor;
  }
}

// Sets the derivatives by coefficient `k` after ProjectBy; `by_k` is the derivative of D by it.
template <class V, int kNumDistortion>
HEBA_INLINE void SetByCoefficient(const V& by_k, int k, DistortedImage<V, kNumDistortion>* image) {
  image->x_by_distortion[k] *= by_k;
  image->y_by_distortion[k] *= by_k;
}

}  // namespace heba
