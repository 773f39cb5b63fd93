// heba's closed forms against OpenCV's, two implementations of the same papers. cv::calibrateHandEye is documented for
// eye-in-hand: it takes gripper poses in the base and camera_from_target and finds gripper_from_camera. Eye-to-hand is
// the same equation with the inverse of those gripper poses; "gripper" and "base" in OpenCV's names are then the
// camera's and the target's mount.
//
// Compared only where Debian's OpenCV 4.6 is sound: no two captures may differ by a turn of 120 deg or more
// (TsaiAndDaniilidisAreWrongOnExactData).
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "solvers/hand_eye_method.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

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

// cv::calibrateHandEye's "base" is the frame that the target stands in, its "gripper" the one that the camera is fixed
// to. Its gripper_from_camera.
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

// cv::calibrateRobotWorldHandEye's "world" is our target, its "base" our target's mount, its "gripper" our camera's
// mount: it finds base_from_world and gripper_from_camera, both the other way round.
HandEye OpenCvRobotWorld(const std::vector<PosePair>& pairs, cv::RobotWorldHandEyeCalibrationMethod method) {
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
  return {Inverse(PoseOf(camera_rotation, camera_translation)), Inverse(PoseOf(world_rotation, world_translation))};
}

HandEye OpenCvSolve(const std::string& name, const std::vector<PosePair>& pairs) {
  static const std::map<std::string, cv::HandEyeCalibrationMethod> kHandEye = {
      {"tsai", cv::CALIB_HAND_EYE_TSAI},
      {"park", cv::CALIB_HAND_EYE_PARK},
      {"horaud", cv::CALIB_HAND_EYE_HORAUD},
      {"andreff", cv::CALIB_HAND_EYE_ANDREFF},
      {"daniilidis", cv::CALIB_HAND_EYE_DANIILIDIS}};
  const auto hand_eye = kHandEye.find(name);
  if (hand_eye != kHandEye.end()) return {OpenCvHandEye(pairs, hand_eye->second), Rigid3d()};
  return OpenCvRobotWorld(pairs,
                          name == "shah" ? cv::CALIB_ROBOT_WORLD_HAND_EYE_SHAH : cv::CALIB_ROBOT_WORLD_HAND_EYE_LI);
}

// Captures of which no two differ by a turn of more than `max_turn_rad`, the camera's poses with noise.
TestScene SceneOfTurns(heba::Setup setup, uint64_t seed, double max_turn_rad, double rotation_sigma_rad,
                       double translation_sigma_m) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 30;
  TestScene scene = MakeTestScene(seed, options);
  std::vector<PosePair> kept;
  for (const PosePair& pair : scene.pairs) {
    const bool fits = std::all_of(kept.begin(), kept.end(), [&](const PosePair& other) {
      return AngleRad(pair.camera_from_target, other.camera_from_target) < max_turn_rad;
    });
    if (fits) kept.push_back(pair);
  }
  Rng rng(seed + 1000);
  for (PosePair& pair : kept) {
    pair.camera_from_target = WithRobotNoise(pair.camera_from_target, rotation_sigma_rad, translation_sigma_m, &rng);
  }
  scene.pairs = kept;
  return scene;
}

constexpr double kSoundTurnRad = 1.9;  // Less than 120 deg.

class OpenCvCrossCheck : public testing::TestWithParam<std::string> {
 protected:
  Rigid3d Ours(const TestScene& scene) const {
    return FindHandEyeMethod(GetParam())->solve(scene.pairs)->camera_mount_from_camera;
  }
  Rigid3d Theirs(const TestScene& scene) const { return OpenCvSolve(GetParam(), scene.pairs).camera_mount_from_camera; }
};

TEST_P(OpenCvCrossCheck, AgreesOnExactData) {
  constexpr double kRoundOff = 1e-9;  // rad and m
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const TestScene scene = SceneOfTurns(setup, seed, kSoundTurnRad, 0, 0);
      ASSERT_GE(scene.pairs.size(), 8U);
      EXPECT_THAT(Theirs(scene), IsNearPose(Ours(scene), kRoundOff, kRoundOff)) << SetupName(setup) << " " << seed;
    }
  }
}

// A capture is off by 0.02 deg and 0.2 mm an axis. The two weigh their equations in different ways and so differ by as
// much as their own errors: to 0.02 deg and 0.6 mm.
TEST_P(OpenCvCrossCheck, AgreesWithinTheErrorOnNoisyData) {
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const TestScene scene = SceneOfTurns(setup, seed, kSoundTurnRad, DegToRad(0.02), 0.0002);
      EXPECT_THAT(Theirs(scene), IsNearPose(Ours(scene), DegToRad(0.04), 0.001)) << SetupName(setup) << " " << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Table, OpenCvCrossCheck,
                         testing::Values("tsai", "park", "horaud", "andreff", "daniilidis", "shah", "li"),
                         [](const auto& test) { return test.param; });

// Two captures that differ by more than 120 deg: OpenCV's Tsai and Daniilidis take the quaternion of such a turn with
// either sign, and so a turn the long way round against one the short way round. Exact data then give errors of
// degrees, whichever the set-up is; heba's stay exact.
TEST(OpenCvLargeTurns, TsaiAndDaniilidisAreWrongOnExactData) {
  for (const std::string name : {"tsai", "daniilidis"}) {
    double worst_rad = 0;
    for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
      for (uint64_t seed = 1; seed <= 10; ++seed) {
        const TestScene scene = SceneOfTurns(setup, seed, kPi, 0, 0);
        const Rigid3d truth = scene.hand_eye.camera_mount_from_camera;
        worst_rad = std::max(worst_rad, AngleRad(OpenCvSolve(name, scene.pairs).camera_mount_from_camera, truth));
        EXPECT_THAT(FindHandEyeMethod(name)->solve(scene.pairs)->camera_mount_from_camera,
                    IsNearPose(truth, 1e-9, 1e-9));
      }
    }
    EXPECT_GT(worst_rad, DegToRad(1)) << name << ": a newer OpenCV may have mended this";
  }
}

}  // namespace
}  // namespace heba
