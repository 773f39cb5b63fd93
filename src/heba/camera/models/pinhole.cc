// The pinhole model: u = fx x / z + cx, v = fy y / z + cy.
#include "heba/camera/batched_camera_model.h"
#include "heba/camera/opencv_lens.h"

namespace heba {
namespace {

struct Pinhole : OpenCvPolynomial<0> {
  static constexpr int kNumDistortion = 0;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.examples = {{"wide", {1000, 1020, 652.3, 470.9}}, {"narrow", {1100, 1122, 652.3, 470.9}}};
    return facts;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* /*distortion*/, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const V inverse = ReciprocalOrNaN<V>(z);
    image->x = x * inverse;
    image->y = y * inverse;
    image->x_by_point[0] = inverse;
    image->x_by_point[1] = AllLanes<V>(0);
    image->x_by_point[2] = -image->x * inverse;
    image->y_by_point[0] = AllLanes<V>(0);
    image->y_by_point[1] = inverse;
    image->y_by_point[2] = -image->y * inverse;
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_pinhole() {
  static const BatchedCameraModel<Pinhole> model("pinhole");
  return model;
}

}  // namespace heba
