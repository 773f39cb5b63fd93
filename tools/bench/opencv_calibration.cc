#include "tools/bench/opencv_calibration.h"

#include <map>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace heba {
namespace {

cv::Mat RotationOf(const Rigid3d& pose) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  cv::Mat matrix(3, 3, CV_64F);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix.at<double>(row, column) = rotation(row, column);
  }
  return matrix;
}

cv::Mat TranslationOf(const Rigid3d& pose) {
  return (cv::Mat_<double>(3, 1) << pose.translation.x(), pose.translation.y(), pose.translation.z());
}

Rigid3d PoseOf(const cv::Mat& rotation, const cv::Mat& translation) {
  Eigen::Matrix3d matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix(row, column) = rotation.at<double>(row, column);
  }
  return {Eigen::Quaterniond(matrix),
          Eigen::Vector3d(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2))};
}

// Returns gripper_from_camera of cv::calibrateHandEye. Its "base" is the frame that the target is fixed in, its
// "gripper" the frame that the camera is fixed to.
Rigid3d OpenCvHandEye(const std::vector<PosePair>& pairs, cv::HandEyeCalibrationMethod method) {
  std::vector<cv::Mat> rotations[2];
  std::vector<cv::Mat> translations[2];
  for (const PosePair& pair : pairs) {
    const Rigid3d target_mount_from_camera_mount = Inverse(pair.camera_mount_from_target_mount);
    rotations[0].push_back(RotationOf(target_mount_from_camera_mount));
    translations[0].push_back(TranslationOf(target_mount_from_camera_mount));
    rotations[1].push_back(RotationOf(pair.camera_from_target));
    translations[1].push_back(TranslationOf(pair.camera_from_target));
  }
  cv::Mat rotation;
  cv::Mat translation;
  cv::calibrateHandEye(rotations[0], translations[0], rotations[1], translations[1], rotation, translation, method);
  return PoseOf(rotation, translation);
}

// The "world" of cv::calibrateRobotWorldHandEye is our target, its "base" our target mount, its "gripper" our camera
// mount. It estimates base_from_world and gripper_from_camera, both as their inverses.
Rigid3d OpenCvRobotWorld(const std::vector<PosePair>& pairs, cv::RobotWorldHandEyeCalibrationMethod method) {
  std::vector<cv::Mat> rotations[2];
  std::vector<cv::Mat> translations[2];
  for (const PosePair& pair : pairs) {
    rotations[0].push_back(RotationOf(pair.camera_from_target));
    translations[0].push_back(TranslationOf(pair.camera_from_target));
    rotations[1].push_back(RotationOf(pair.camera_mount_from_target_mount));
    translations[1].push_back(TranslationOf(pair.camera_mount_from_target_mount));
  }
  cv::Mat world_rotation;
  cv::Mat world_translation;
  cv::Mat camera_rotation;
  cv::Mat camera_translation;
  cv::calibrateRobotWorldHandEye(rotations[0], translations[0], rotations[1], translations[1], world_rotation,
                                 world_translation, camera_rotation, camera_translation, method);
  return Inverse(PoseOf(camera_rotation, camera_translation));
}

}  // namespace

Camera CalibrateCameraWithOpenCv(const PairProblem& problem) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const View& view : problem.views) {
    const Observations& observations = view.observations;
    points.emplace_back();
    pixels.emplace_back();
    for (Eigen::Index i = 0; i < observations.size(); ++i) {
      const Eigen::Vector3f point = observations.points_in_target.col(i).cast<float>();
      const Eigen::Vector2f pixel = observations.pixels.col(i).cast<float>();
      points.back().emplace_back(point.x(), point.y(), point.z());
      pixels.back().emplace_back(pixel.x(), pixel.y());
    }
  }
  cv::Mat matrix;
  cv::Mat distortion;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::calibrateCamera(points, pixels, {problem.camera.width_px, problem.camera.height_px}, matrix, distortion,
                      rotations, translations);
  Camera camera = problem.camera;
  camera.model = "brown5";
  camera.params = {matrix.at<double>(0, 0), matrix.at<double>(1, 1), matrix.at<double>(0, 2), matrix.at<double>(1, 2)};
  for (int i = 0; i < 5; ++i) camera.params.push_back(distortion.at<double>(i));
  return camera;
}

Rigid3d SolveHandEyeWithOpenCv(const std::string& method, const std::vector<PosePair>& pairs) {
  static const std::map<std::string, cv::HandEyeCalibrationMethod> kHandEye = {
      {"tsai", cv::CALIB_HAND_EYE_TSAI},
      {"park", cv::CALIB_HAND_EYE_PARK},
      {"horaud", cv::CALIB_HAND_EYE_HORAUD},
      {"andreff", cv::CALIB_HAND_EYE_ANDREFF},
      {"daniilidis", cv::CALIB_HAND_EYE_DANIILIDIS}};
  const auto hand_eye = kHandEye.find(method);
  if (hand_eye != kHandEye.end()) return OpenCvHandEye(pairs, hand_eye->second);
  return OpenCvRobotWorld(pairs,
                          method == "shah" ? cv::CALIB_ROBOT_WORLD_HAND_EYE_SHAH : cv::CALIB_ROBOT_WORLD_HAND_EYE_LI);
}

}  // namespace heba
