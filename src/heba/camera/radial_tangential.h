// Common parts of the lenses with a radial factor and Brown's tangential terms p1, p2 (distortion coefficients 2 and
// 3).
#pragma once

#include "heba/camera/batched_camera_model.h"

namespace heba {

// The undistorted image of a ray in the plane z = 1; not finite unless the ray points forward.
template <class V>
struct PlaneImage {
  V a;
  V b;
  V r2;
  V inverse_z;
};
template <class V>
HEBA_INLINE PlaneImage<V> PlaneImageOf(const V& x, const V& y, const V& z) {
  PlaneImage<V> plane;
  plane.inverse_z = ReciprocalOrNaN<V>(z);
  plane.a = x * plane.inverse_z;
  plane.b = y * plane.inverse_z;
  plane.r2 = plane.a * plane.a + plane.b * plane.b;
  return plane;
}

// Computes everything except the derivatives by the radial coefficients.
template <class V, int kNumDistortion>
HEBA_INLINE void DistortRadialTangential(const PlaneImage<V>& plane, const V& radial, const V& radial_by_r2, double p1,
                                         double p2, DistortedImage<V, kNumDistortion>* image) {
  const V aa = plane.a * plane.a;
  const V bb = plane.b * plane.b;
  const V ab2 = 2.0 * plane.a * plane.b;
  const V by_p2 = plane.r2 + 2.0 * aa;
  const V by_p1 = plane.r2 + 2.0 * bb;
  image->x = plane.a * radial + p1 * ab2 + p2 * by_p2;
  image->y = plane.b * radial + p1 * by_p1 + p2 * ab2;
  image->x_by_distortion[2] = ab2;
  image->x_by_distortion[3] = by_p2;
  image->y_by_distortion[2] = by_p1;
  image->y_by_distortion[3] = ab2;
  const V x_by_a = radial + 2.0 * aa * radial_by_r2 + (2.0 * p1) * plane.b + (6.0 * p2) * plane.a;
  const V y_by_b = radial + 2.0 * bb * radial_by_r2 + (6.0 * p1) * plane.b + (2.0 * p2) * plane.a;
  const V cross = ab2 * radial_by_r2 + (2.0 * p1) * plane.a + (2.0 * p2) * plane.b;
  image->x_by_point[0] = x_by_a * plane.inverse_z;
  image->x_by_point[1] = cross * plane.inverse_z;
  image->x_by_point[2] = -(plane.a * image->x_by_point[0] + plane.b * image->x_by_point[1]);
  image->y_by_point[0] = image->x_by_point[1];
  image->y_by_point[1] = y_by_b * plane.inverse_z;
  image->y_by_point[2] = -(plane.a * image->y_by_point[0] + plane.b * image->y_by_point[1]);
}

// Sets the derivatives by the radial coefficient `k`; `by_k` is the derivative of the radial factor by it.
template <class V, int kNumDistortion>
HEBA_INLINE void SetByRadial(const PlaneImage<V>& plane, const V& by_k, int k,
                             DistortedImage<V, kNumDistortion>* image) {
  image->x_by_distortion[k] = plane.a * by_k;
  image->y_by_distortion[k] = plane.b * by_k;
}

}  // namespace heba
