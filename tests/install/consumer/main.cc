// What a program that uses heba as a library looks like: solves a small exact problem, makes a target,
// and writes a picture.
#include <cmath>
#include <cstdio>

#include "heba/camera/camera.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "targets/images/image.h"
#include "targets/target.h"

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
  const heba::Outcome<heba::HandEye> found = heba::FindHandEyeMethod("park")->solve(pairs);
  if (!found || heba::DistanceM(found->camera_mount_from_camera, truth.camera_mount_from_camera) > 1e-9) return 1;
  heba::MapReader reader(heba::ParseYaml("{type: chessboard, rows: 6, columns: 8, square: 30 mm}", "board"));
  const std::unique_ptr<heba::Target> target = heba::CreateTarget(reader);
  // Pictures' formats are loaded at run time, from wherever the program is.
  if (heba::SmallJpeg(cv::Mat::zeros(48, 64, CV_8UC1), 32).empty()) return 1;
  std::printf("%zu points\n", target->points().size());
  return target->points().size() == 48 ? 0 : 1;
}
