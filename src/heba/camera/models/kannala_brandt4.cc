// The model of Kannala and Brandt 2006 with four coefficients, in the notation of OpenCV's fisheye module and of ROS
// (equidistant). If theta is the angle between the ray and the optical axis and phi its azimuth,
//   r = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8),  u = fx r cos(phi) + cx,  v = fy r sin(phi) + cy
// Rays that point backwards are projected too; only the ray straight backwards has no image.
#include <algorithm>

#include "heba/camera/batched_camera_model.h"
#include "heba/camera/opencv_lens.h"

namespace heba {
namespace {

struct KannalaBrandt4 : OpenCvFisheye {
  static constexpr int kNumDistortion = 4;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.kind = LensKind::kFisheye;
    facts.distortion_names = {"k1", "k2", "k3", "k4"};
    facts.kalibr = {"pinhole", "equidistant"};
    facts.examples = {{"undistorted", {500, 510, 652.3, 470.9, 0, 0, 0, 0}},
                      {"typical", {520, 530.4, 652.3, 470.9, -0.02, 0.004, -0.002, 0.0003}},
                      // The field of view is 180 degrees or more.
                      {"strong_positive", {420, 428.4, 652.3, 470.9, 0.04, -0.01, 0.002, -0.0002}},
                      {"strong_negative", {450, 459, 652.3, 470.9, -0.05, 0.01, -0.0015, 0.0001}}};
    return facts;
  }

  // Computes x' = x s, y' = y s with s = r / rho, where rho is the distance from the optical axis.
  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double k1 = distortion[0];
    const double k2 = distortion[1];
    const double k3 = distortion[2];
    const double k4 = distortion[3];
    const V rho2 = x * x + y * y;
    const V zz = z * z;
    const auto is_on_axis = rho2 <= zz * 1e-16;
    const V rho = EachLane<V>(rho2, rho2, [](double a, double) { return std::sqrt(a); });
    const V theta = EachLane<V>(rho, z, [](double a, double b) { return std::atan2(a, b); });
    const V on_axis = ReciprocalOrNaN<V>(z);  // theta / rho on the optical axis.
    const V one = AllLanes<V>(1);
    const V theta_by_rho = is_on_axis ? on_axis : theta / (is_on_axis ? one : rho);
    const V theta2 = theta * theta;
    const V polynomial = 1.0 + theta2 * (k1 + theta2 * (k2 + theta2 * (k3 + theta2 * k4)));
    const V r_by_theta = 1.0 + theta2 * (3.0 * k1 + theta2 * (5.0 * k2 + theta2 * (7.0 * k3 + theta2 * (9.0 * k4))));
    const V s = theta_by_rho * polynomial;
    image->x = x * s;
    image->y = y * s;
    // The derivative of theta is z / (rho^2 + z^2) by rho and -rho / (rho^2 + z^2) by z.
    const V inverse_range2 = 1.0 / (rho2 + zz);
    const V s_by_z = -r_by_theta * inverse_range2;
    // (d s / d rho) / rho. On the axis, x and y are so small that it does not matter.
    const V zero = AllLanes<V>(0);
    const V s_by_rho = is_on_axis ? zero : (r_by_theta * z * inverse_range2 - s) / (is_on_axis ? one : rho2);
    image->x_by_point[0] = s + x * x * s_by_rho;
    image->x_by_point[1] = x * y * s_by_rho;
    image->x_by_point[2] = x * s_by_z;
    image->y_by_point[0] = image->x_by_point[1];
    image->y_by_point[1] = s + y * y * s_by_rho;
    image->y_by_point[2] = y * s_by_z;
    V power = theta_by_rho * theta2;
    for (int k = 0; k < kNumDistortion; ++k) {
      image->x_by_distortion[k] = x * power;
      image->y_by_distortion[k] = y * power;
      power *= theta2;
    }
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d m((pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1]);
    const double r = m.norm();
    if (r < 1e-12) return Eigen::Vector3d::UnitZ();
    const double theta = std::min(r, 3.0);
    return {m.x() / r * std::sin(theta), m.y() / r * std::sin(theta), std::cos(theta)};
  }
};

}  // namespace

const CameraModel& CameraModel_kannala_brandt4() {
  static const BatchedCameraModel<KannalaBrandt4> model("kannala_brandt4");
  return model;
}

}  // namespace heba
