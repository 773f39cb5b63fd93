// Solves a small exact problem by every closed form that can use its motion.
#include <cmath>
#include <cstdio>

#include "heba/closed_form.h"

int main() {
  using heba::ExpRotation;
  using heba::Rigid3d;
  const heba::HandEye truth{Rigid3d(ExpRotation({0.1, 2.0, -0.4}), Eigen::Vector3d(0.5, 0.1, 0.9)),
                            Rigid3d(ExpRotation({0.3, 0.0, 0.2}), Eigen::Vector3d(0.0, 0.05, 0.1))};
  std::vector<heba::PosePair> pairs;
  for (int i = 0; i < 6; ++i) {
    const Rigid3d mount(ExpRotation({0.3 * std::sin(i), 0.2 * std::cos(2 * i), 0.1 * i}),
                        Eigen::Vector3d(0.1 * i, std::sin(i), 0.5));
    pairs.push_back({mount, heba::CameraFromTarget(truth, mount)});
  }
  int num_exact = 0;
  for (const heba::ClosedForm& method : heba::ClosedForms()) {
    const heba::Outcome<heba::HandEye> found = heba::SolveClosedForm(method.name, pairs);
    if (!found) {
      std::printf("%s: %s\n", method.name.c_str(), found.reason().c_str());
      continue;
    }
    const double error_m = heba::DistanceM(found->camera_mount_from_camera, truth.camera_mount_from_camera);
    std::printf("%s: %.1e m\n", method.name.c_str(), error_m);
    if (error_m > 1e-6) return 1;
    ++num_exact;
  }
  return num_exact >= 5 ? 0 : 1;
}
