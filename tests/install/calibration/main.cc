// Reads a hand-eye data set as plain numbers, one line for each capture, and prints the refined pose of each camera in
// the gripper with its uncertainty: x y z qx qy qz qw of base_from_gripper, then, for each camera that the gripper
// carries, u v of each of the 6 x 9 points of a 20 mm grid. The number of cameras is the argument.
#include <iostream>
#include <string>

#include "heba/calibration.h"

int main(int argc, char** argv) {
  const size_t num_cameras = argc > 1 ? std::stoul(argv[1]) : 1;
  heba::Observations grid;
  grid.points_in_target.setZero(3, 54);
  grid.pixels.resize(2, 54);
  for (int i = 0; i < 54; ++i) {
    grid.ids.push_back(i);
    grid.points_in_target.col(i).head<2>() << 0.02 * (i % 9), 0.02 * (i / 9);
  }
  heba::Problem problem;
  problem.robots = {"arm"};
  problem.targets.push_back({"board", {}, heba::DesignedShape(grid.points_in_target)});
  for (size_t c = 0; c < num_cameras; ++c) {
    heba::ProblemCamera& camera = problem.cameras.emplace_back();
    camera.name = std::to_string(c);
    camera.mount.part = heba::Mount::Part::kGripper;
    camera.camera.width_px = 1280;
    camera.camera.height_px = 960;
    camera.free_intrinsics = heba::BundleOptions().free_intrinsics;
  }
  for (double p[7]; std::cin >> p[0] >> p[1] >> p[2] >> p[3] >> p[4] >> p[5] >> p[6];) {
    heba::ProblemCapture& capture = problem.captures.emplace_back();
    capture.name = std::to_string(problem.captures.size());
    capture.base_from_gripper = {{Eigen::Quaterniond(p[6], p[3], p[4], p[5]), {p[0], p[1], p[2]}}};
    for (size_t c = 0; c < num_cameras; ++c) {
      for (int i = 0; i < 54; ++i) std::cin >> grid.pixels(0, i) >> grid.pixels(1, i);
      capture.images.push_back({c, 0, grid});
    }
  }
  const heba::Outcome<heba::Calibration> calibration = heba::Calibrate(problem, heba::CalibrationOptions());
  if (!calibration || !calibration->refined) {
    std::cerr << (calibration ? calibration->refined.reason() : calibration.reason()) << "\n";
    return 1;
  }
  const heba::Solution& solution = *calibration->refined;
  for (size_t c = 0; c < num_cameras; ++c) {
    const std::string block = heba::CameraPoseBlock(problem.cameras[c]);
    std::cout << solution.poses.mount_from_camera[c].translation.transpose() << " m\n";
    std::cout << heba::PoseCovarianceOf(solution.covariance, block)->diagonal().cwiseSqrt().transpose() << "\n";
  }
}
