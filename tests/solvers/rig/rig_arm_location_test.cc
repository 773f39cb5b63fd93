// Tests of the location of targets with cameras on arms whose kinematics have errors.
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "heba/base/units.h"
#include "heba/rig_adjustment.h"
#include "heba/rig_location.h"
#include "tests/support/rig_arm_scenes.h"

namespace heba {
namespace {

constexpr ArmErrorSigmas kErrors = {DegToRad(0.05), 0.3e-3, DegToRad(0.03), 0};
constexpr double kNoisePx = 0.1;
constexpr int kNumCaptures = 30;

// A calibrated rig, and an object that the cameras see at one pose of the arms, which is that of no capture.
struct SeenObject {
  RigArmScene scene;  // The captures of the calibration, with the errors of the arms.
  RigSolution solution;
  Rigid3d world_from_object;
  std::vector<StatedPose> plain;        // The poses that the arms report.
  std::vector<StatedPose> with_errors;  // Likewise, with the errors of the arms.
  std::vector<CameraObservations> seen;
};

// Returns the rig with errors of its arms of the largest model.
RigProblem WithArmErrors(RigProblem problem, const RigArmScene& scene) {
  const std::vector<RigArmErrors> errors = ErrorsOf(scene);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const std::shared_ptr<const SharedEffects>& model = errors[r].models.back();
    problem.effects.push_back(model);
    std::vector<int> indices;
    for (const SharedEffect& effect : model->effects) indices.push_back(effect.index);
    for (size_t i = 0; i < problem.captures.size(); ++i) {
      problem.captures[i].effects.push_back(
          SelectEffects(errors[r].effects_of_captures.front()[i], model->num_all, indices));
    }
  }
  return problem;
}

// `camera` is the one in front of which the object is.
SeenObject SeeObject(RigArmScene scene, size_t camera, uint64_t seed) {
  SeenObject object;
  const ArmPoses arms = scene.rig.arms.back();
  const RigCapture last = scene.rig.problem.captures.back();
  for (size_t r = 0; r < arms.size(); ++r) {
    const SimulatedArm& arm = *scene.arms[r];
    object.plain.emplace_back(last.base_from_gripper[r]);
    object.with_errors.emplace_back(
        last.base_from_gripper[r], MakeArmEffect(arm.nominal, scene.joints.back()[r], arm.tip_from_gripper),
        GripperByJoints(arm.nominal, scene.joints.back()[r], arm.tip_from_gripper));
  }
  scene.rig.problem.captures.pop_back();
  scene.rig.problem = WithArmErrors(std::move(scene.rig.problem), scene);
  Outcome<RigSolution> solution = RefineRig(scene.rig.problem, scene.rig.truth, {});
  CHECK(solution.ok()) << solution.reason();
  object.solution = std::move(*solution);

  Rng rng(seed);
  const auto world_from_camera = [&](size_t c) {
    return WorldFromMount(scene.rig.problem.cameras[c].mount, scene.rig.truth.world_from_base, arms) *
           scene.rig.truth.mount_from_camera[c];
  };
  object.world_from_object =
      world_from_camera(camera) * Rigid3d(ExpRotation({0.3, -0.2, 0.5}), Eigen::Vector3d(0.02, 0.03, 0.6));
  const SimulatedTarget& target = scene.rig.targets[0];
  for (size_t c = 0; c < scene.rig.problem.cameras.size(); ++c) {
    const Camera& of_camera = scene.rig.problem.cameras[c].camera;
    const Rigid3d camera_from_object = Inverse(world_from_camera(c)) * object.world_from_object;
    if (!IsVisible(of_camera, camera_from_object, target, 5)) continue;
    object.seen.push_back(
        {c, SimulateView("", of_camera, {}, camera_from_object, target.points_in_target, kNoisePx, &rng)
                ->observations});
  }
  object.scene = std::move(scene);
  return object;
}

RigSceneSetting Setting() {
  RigSceneSetting setting;
  setting.num_captures = kNumCaptures + 1;
  setting.noise_px = kNoisePx;
  setting.robot_noise = {0.02e-3, DegToRad(0.004), 0};
  return setting;
}

// What is summed over trials.
struct Sums {
  double pose_chi2 = 0;
  double point_chi2 = 0;
  double squares_m2 = 0;
  int num_poses = 0;
  int num_points = 0;

  void Add(const SeenObject& object, const std::vector<StatedPose>& arms) {
    const RigProblem& rig = object.scene.rig.problem;
    const Outcome<RigLocation> located = LocateInRig(rig, object.solution, object.seen, arms);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object.world_from_object);
    pose_chi2 += error.dot(located->Total().ldlt().solve(error));
    squares_m2 += error.head<3>().squaredNorm();
    ++num_poses;
    if (object.seen.size() < 2) return;
    std::vector<CameraPixel> pixels;
    for (const CameraObservations& view : object.seen) {
      pixels.push_back({view.camera, view.observations.pixels.col(5)});
    }
    const Outcome<RigPoint> point = TriangulateInRig(rig, object.solution, pixels, arms);
    ASSERT_TRUE(point) << point.reason();
    const Eigen::Vector3d truth =
        object.world_from_object * Eigen::Vector3d(object.scene.rig.targets[0].points_in_target.col(5));
    const Eigen::Vector3d off = point->in_world - truth;
    point_chi2 += off.dot(point->TotalM2().ldlt().solve(off));
    ++num_points;
  }
};

// The mean of the chi-squares with 6 degrees of freedom is within 4 standard deviations of 6, and that of points with 3
// within 4 of 3. Without the correction,
// the errors of the arm are larger than all that the covariance knows of.
TEST(RigArmLocation, ErrorsAgreeWithTheCovarianceAndAreSmallerThanWithoutTheCorrection) {
  constexpr int kNumTrials = 40;
  constexpr size_t kWrist = 2;
  Sums corrected;
  Sums plain;
  for (uint64_t seed = 1; seed <= kNumTrials; ++seed) {
    const RigSceneSetting setting = Setting();
    const SeenObject object =
        SeeObject(WithArms(ReachableRig(seed, setting), setting, kErrors, seed + 1000,
                           ArmErrorsOf::kDeterminedParameters),
                  kWrist, seed + 2000);
    ASSERT_FALSE(object.seen.empty());
    corrected.Add(object, object.with_errors);
    plain.Add(object, object.plain);
  }
  std::printf("mean chi-square %.2f (6), without the correction %.2f; points %.2f (3) of %d; errors %.4f and %.4f mm\n",
              corrected.pose_chi2 / kNumTrials, plain.pose_chi2 / kNumTrials,
              corrected.point_chi2 / corrected.num_points, corrected.num_points,
              1000 * std::sqrt(corrected.squares_m2 / kNumTrials), 1000 * std::sqrt(plain.squares_m2 / kNumTrials));
  EXPECT_NEAR(corrected.pose_chi2 / kNumTrials, 6, 4 * std::sqrt(12.0 / kNumTrials));
  ASSERT_GE(corrected.num_points, 10);
  EXPECT_NEAR(corrected.point_chi2 / corrected.num_points, 3, 4 * std::sqrt(6.0 / corrected.num_points));
  EXPECT_GT(plain.pose_chi2 / kNumTrials, 12);
  EXPECT_LT(corrected.squares_m2, 0.25 * plain.squares_m2);
}

}  // namespace
}  // namespace heba
