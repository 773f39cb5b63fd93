#include "heba/rig_location.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "heba/base/units.h"
#include "heba/rig_adjustment.h"
#include "tests/support/matchers.h"
#include "tests/support/rig_scenes.h"

namespace heba {
namespace {

// A calibrated rig, and an object that its cameras see at one pose of the arm.
struct SeenObject {
  RigScene scene;
  RigSolution solution;
  Rigid3d world_from_target;
  std::vector<Rigid3d> reported;
  std::vector<CameraObservations> seen;
};

enum class Where { kBetweenFixedCameras, kBeforeTheWrist };
std::optional<SeenObject> SeeObject(uint64_t seed, double noise_px, Where where = Where::kBetweenFixedCameras) {
  RigSceneSetting setting;
  setting.num_captures = 30;
  setting.noise_px = noise_px;
  if (noise_px == 0) setting.robot_noise = {};
  SeenObject object;
  object.scene = MixedRig(seed, setting);
  RigScene& scene = object.scene;
  RigOptions options;
  if (noise_px == 0) options.robot = BundleOptions::Robot::kExact;
  Outcome<RigSolution> solution = RefineRig(scene.problem, scene.truth, options);
  if (!solution) return std::nullopt;
  object.solution = std::move(*solution);
  // The object is where the plate is in a capture in which the camera on the wrist sees the wall: both fixed cameras
  // see it, or one of them.
  Rng rng(seed + 1);
  const ArmPoses& arms = scene.arms.front();
  object.world_from_target = LookingAt({0.55, 0.02, 0.42}, {0.55, -0.6, 0.1}, 0.3);
  if (where == Where::kBeforeTheWrist) {
    object.world_from_target =
        arms[0] * scene.truth.mount_from_camera[2] * Rigid3d(ExpRotation({0.3, -0.2, 0.5}), Eigen::Vector3d(0, 0, 0.6));
  }
  object.reported = {ReportedPose(arms[0], setting.robot_noise, &rng)};
  const SimulatedTarget& target = scene.targets[0];
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    const Rigid3d world_from_camera =
        WorldFromMount(scene.problem.cameras[c].mount, scene.truth.world_from_base, arms) *
        scene.truth.mount_from_camera[c];
    const Rigid3d camera_from_target = Inverse(world_from_camera) * object.world_from_target;
    if (!IsVisible(scene.problem.cameras[c].camera, camera_from_target, target, 5)) continue;
    object.seen.push_back({c, SimulateView("", scene.problem.cameras[c].camera, {}, camera_from_target,
                                           target.points_in_target, noise_px, &rng)
                                  ->observations});
  }
  return object;
}

TEST(RigLocation, FindsTheExactPoseWithoutNoise) {
  const std::optional<SeenObject> object = SeeObject(1, 0);
  ASSERT_TRUE(object.has_value());
  ASSERT_GE(object->seen.size(), 2U);
  const Outcome<RigLocation> located =
      LocateInRig(object->scene.problem, object->solution, object->seen, object->reported);
  ASSERT_TRUE(located) << located.reason();
  EXPECT_THAT(located->world_from_target, IsNearPose(object->world_from_target, 1e-7, 1e-7));
  EXPECT_LT(located->rms_px, 1e-4);
}

// The mean of the chi-squares with 6 degrees of freedom over 60 trials is within 4 standard deviations (of 0.45) of 6,
// and that of a point with 3 within 4 of 0.32.
TEST(RigLocation, ErrorsAgreeWithTheCovariance) {
  double pose_sum = 0;
  double point_sum = 0;
  int num_trials = 0;
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    const std::optional<SeenObject> object = SeeObject(seed, 0.1);
    ASSERT_TRUE(object.has_value());
    if (object->seen.size() < 2) continue;
    ++num_trials;
    const Outcome<RigLocation> located =
        LocateInRig(object->scene.problem, object->solution, object->seen, object->reported);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object->world_from_target);
    pose_sum += error.dot(located->Total().ldlt().solve(error));
    std::vector<CameraPixel> pixels;
    for (const CameraObservations& view : object->seen) {
      pixels.push_back({view.camera, view.observations.pixels.col(5)});
    }
    const Outcome<RigPoint> point = TriangulateInRig(object->scene.problem, object->solution, pixels, object->reported);
    ASSERT_TRUE(point) << point.reason();
    const Eigen::Vector3d true_point =
        object->world_from_target * Eigen::Vector3d(object->scene.targets[0].points_in_target.col(5));
    const Eigen::Vector3d off = point->in_world - true_point;
    point_sum += off.dot(point->TotalM2().ldlt().solve(off));
  }
  ASSERT_GE(num_trials, 40);
  EXPECT_NEAR(pose_sum / num_trials, 6, 4 * std::sqrt(12.0 / num_trials));
  EXPECT_NEAR(point_sum / num_trials, 3, 4 * std::sqrt(6.0 / num_trials));
}

// Likewise for the camera on the wrist, whose arm is noisy: the error of the arm's pose is part of the covariance.
TEST(RigLocation, ErrorsOfACarriedCameraAgreeWithTheCovariance) {
  double pose_sum = 0;
  double robot_m2 = 0;
  double image_m2 = 0;
  constexpr int kNumTrials = 60;
  for (uint64_t seed = 101; seed < 101 + kNumTrials; ++seed) {
    const std::optional<SeenObject> object = SeeObject(seed, 0.1, Where::kBeforeTheWrist);
    ASSERT_TRUE(object.has_value());
    const Outcome<RigLocation> located =
        LocateInRig(object->scene.problem, object->solution, object->seen, object->reported);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object->world_from_target);
    pose_sum += error.dot(located->Total().ldlt().solve(error));
    robot_m2 += located->by_robot.topLeftCorner<3, 3>().trace();
    image_m2 += located->by_image.topLeftCorner<3, 3>().trace();
  }
  EXPECT_NEAR(pose_sum / kNumTrials, 6, 4 * std::sqrt(12.0 / kNumTrials));
  EXPECT_GT(robot_m2, image_m2);
}

TEST(RigLocation, SeveralCamerasAreBetterThanOne) {
  const std::optional<SeenObject> object = SeeObject(2, 0.1);
  ASSERT_TRUE(object.has_value());
  ASSERT_GE(object->seen.size(), 2U);
  const Outcome<RigLocation> all = LocateInRig(object->scene.problem, object->solution, object->seen, object->reported);
  ASSERT_TRUE(all);
  for (const CameraObservations& view : object->seen) {
    const Outcome<RigLocation> one = LocateInRig(object->scene.problem, object->solution, {view}, object->reported);
    ASSERT_TRUE(one);
    EXPECT_LT((all->by_image.topLeftCorner<3, 3>().trace()), (one->by_image.topLeftCorner<3, 3>().trace()));
  }
}

TEST(RigLocation, ParallelRaysAreRefused) {
  const std::optional<SeenObject> object = SeeObject(3, 0);
  ASSERT_TRUE(object.has_value());
  const CameraPixel pixel{0, {800, 600}};
  EXPECT_FALSE(TriangulateInRig(object->scene.problem, object->solution, {pixel}, object->reported));
  EXPECT_FALSE(TriangulateInRig(object->scene.problem, object->solution, {pixel, pixel}, object->reported));
}

}  // namespace
}  // namespace heba
