// Reads a hand-eye data set as plain numbers, one line for each capture, and prints the refined hand-eye pose with its
// uncertainty: x y z qx qy qz qw of base_from_gripper, then u v of each of the 6 x 9 points of a 20 mm grid.
#include <iostream>

#include "heba/calibration.h"

int main() {
  std::vector<heba::View> views;
  for (double p[7]; std::cin >> p[0] >> p[1] >> p[2] >> p[3] >> p[4] >> p[5] >> p[6];) {
    heba::View view;
    view.name = std::to_string(views.size());
    const heba::Rigid3d base_from_gripper(Eigen::Quaterniond(p[6], p[3], p[4], p[5]), {p[0], p[1], p[2]});
    view.camera_mount_from_target_mount = heba::CameraMountFromTargetMount(heba::Setup::kEyeInHand, base_from_gripper);
    view.observations.points_in_target.setZero(3, 54);
    view.observations.pixels.resize(2, 54);
    for (int i = 0; i < 54; ++i) {
      view.observations.ids.push_back(i);
      view.observations.points_in_target.col(i).head<2>() << 0.02 * (i % 9), 0.02 * (i / 9);
      std::cin >> view.observations.pixels(0, i) >> view.observations.pixels(1, i);
    }
    views.push_back(view);
  }
  heba::CalibrationOptions options;
  options.setup = heba::Setup::kEyeInHand;
  options.width_px = 1280;
  options.height_px = 960;
  const heba::Outcome<heba::Calibration> calibration = heba::Calibrate(views, options);
  if (!calibration || !calibration->refined) {
    std::cerr << (calibration ? calibration->refined.reason() : calibration.reason()) << "\n";
    return 1;
  }
  const heba::Solution& solution = *calibration->refined;
  std::cout << solution.hand_eye.camera_mount_from_camera.translation.transpose() << " m\n";
  std::cout << heba::PoseCovarianceOf(solution.covariance, "hand_eye")->diagonal().cwiseSqrt().transpose() << "\n";
}
