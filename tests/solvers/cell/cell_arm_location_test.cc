// Tests of the location of targets with cameras on arms whose kinematics have errors.
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/location.h"
#include "heba/refinement.h"
#include "tests/support/cell_arm_scenes.h"

namespace heba {
namespace {

constexpr ArmErrorSigmas kErrors = {DegToRad(0.05), 0.3e-3, DegToRad(0.03), 0};
constexpr double kNoisePx = 0.1;
constexpr int kNumCaptures = 16;
constexpr size_t kWrist = 2;  // The camera on the gripper.

// A calibrated rig, and an object that the cameras see at one pose of the arms, which is that of no capture.
struct SeenObject {
  CellArmScene scene;  // The captures of the calibration, with the errors of the arms.
  Solution solution;
  Rigid3d world_from_object;
  std::vector<StatedPose> plain;        // The poses that the arms report.
  std::vector<StatedPose> with_errors;  // Likewise, with the errors of the arms.
  std::vector<CameraObservations> seen;
};

// Returns the rig with errors of its arms of the largest model.
Problem WithArmErrors(Problem problem, const CellArmScene& scene) {
  const std::vector<ArmErrorModels> errors = ErrorsOf(scene);
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
SeenObject SeeObject(CellArmScene scene, size_t camera, uint64_t seed) {
  SeenObject object;
  const ArmPoses arms = scene.rig.arms.back();
  const ProblemCapture last = scene.rig.problem.captures.back();
  for (size_t r = 0; r < arms.size(); ++r) {
    const SimulatedArm& arm = *scene.arms[r];
    object.plain.emplace_back(last.base_from_gripper[r]);
    object.with_errors.emplace_back(last.base_from_gripper[r],
                                    MakeArmEffect(arm.nominal, scene.joints.back()[r], arm.tip_from_gripper),
                                    GripperByJoints(arm.nominal, scene.joints.back()[r], arm.tip_from_gripper));
  }
  scene.rig.problem.captures.pop_back();
  scene.rig.problem = WithArmErrors(std::move(scene.rig.problem), scene);
  Outcome<Solution> solution = RefineProblem(scene.rig.problem, scene.rig.truth, {});
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
        {c, SimulateView("", of_camera, {}, camera_from_object, target.points_in_target, kNoisePx, rng)->observations});
  }
  object.scene = std::move(scene);
  return object;
}

CellSceneSetting Setting() {
  CellSceneSetting setting;
  setting.num_captures = kNumCaptures + 1;
  setting.noise_px = kNoisePx;
  setting.robot_noise = {0.02e-3, DegToRad(0.004), 0};
  return setting;
}

// Returns the object as one camera alone sees it.
SeenObject SeenBy(size_t camera, SeenObject object) {
  std::erase_if(object.seen, [&](const CameraObservations& view) { return view.camera != camera; });
  return object;
}

// Returns the solution as if the errors of the arms were known exactly.
Solution WithoutUncertaintyOfErrors(const Problem& rig, Solution solution) {
  for (const std::string& robot : rig.robots) {
    const UnknownBlock block = solution.covariance.layout.Block(ErrorsBlock(robot));
    solution.covariance.matrix.middleRows(block.first, block.size).setZero();
    solution.covariance.matrix.middleCols(block.first, block.size).setZero();
  }
  return solution;
}

// The errors of located objects, over trials.
struct LocationErrors {
  double chi2 = 0;
  double squares_m2 = 0;
  int num = 0;

  double MeanChi2() const { return chi2 / num; }
  double RmsMm() const { return 1000 * std::sqrt(squares_m2 / num); }
  void AddPose(const SeenObject& object, const Solution& solution, const std::vector<StatedPose>& arms) {
    const Outcome<LocatedTarget> located = LocateInCell(object.scene.rig.problem, solution, object.seen, arms);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object.world_from_object);
    chi2 += MahalanobisSquare(error, located->pose_covariance.Total());
    squares_m2 += error.head<3>().squaredNorm();
    ++num;
  }
  void AddPoint(const SeenObject& object, const std::vector<StatedPose>& arms) {
    std::vector<CameraPixel> pixels;
    for (const CameraObservations& view : object.seen) {
      pixels.push_back({view.camera, view.observations.pixels.col(5)});
    }
    const Outcome<LocatedPoint> point = TriangulateInCell(object.scene.rig.problem, object.solution, pixels, arms);
    ASSERT_TRUE(point) << point.reason();
    const Eigen::Vector3d error =
        point->in_world -
        object.world_from_object * Eigen::Vector3d(object.scene.rig.targets[0].points_in_target.col(5));
    chi2 += MahalanobisSquare(error, point->covariance.TotalM2());
    squares_m2 += error.squaredNorm();
    ++num;
  }
};

SeenObject SeeBeforeTheWrist(uint64_t seed) {
  const CellSceneSetting setting = Setting();
  return SeeObject(WithArms(ReachableCell(seed, setting), setting, kErrors, seed + 1000), kWrist, seed + 2000);
}

// The means of the chi-squares with 6 degrees of freedom, and of those with 3 of points, are within 4 standard
// deviations of these. They are much larger if the errors of the arm are not corrected, and larger by a tenth at least,
// in the same trials, if the corrections are taken as known exactly.
void ExpectHonestAndSmallErrors(int num_trials, int least_points) {
  LocationErrors by_all;
  LocationErrors by_wrist;
  LocationErrors points;
  LocationErrors as_if_known;
  LocationErrors plain;
  for (uint64_t seed = 1; seed <= static_cast<uint64_t>(num_trials); ++seed) {
    const SeenObject object = SeeBeforeTheWrist(seed);
    const SeenObject alone = SeenBy(kWrist, object);
    ASSERT_EQ(alone.seen.size(), 1U);
    by_all.AddPose(object, object.solution, object.with_errors);
    by_wrist.AddPose(alone, object.solution, object.with_errors);
    as_if_known.AddPose(alone, WithoutUncertaintyOfErrors(object.scene.rig.problem, object.solution),
                        object.with_errors);
    plain.AddPose(alone, object.solution, object.plain);
    if (object.seen.size() > 1) points.AddPoint(object, object.with_errors);
  }
  std::printf(
      "mean chi-square by all cameras %.2f (6), by the wrist %.2f, as if the errors were known %.2f, without the "
      "correction %.0f; of %d points %.2f (3); errors by the wrist %.3f mm, without the correction %.3f mm\n",
      by_all.MeanChi2(), by_wrist.MeanChi2(), as_if_known.MeanChi2(), plain.MeanChi2(), points.num, points.MeanChi2(),
      by_wrist.RmsMm(), plain.RmsMm());
  const double tolerance = 4 * std::sqrt(12.0 / num_trials);
  EXPECT_NEAR(by_all.MeanChi2(), 6, tolerance);
  EXPECT_NEAR(by_wrist.MeanChi2(), 6, tolerance);
  ASSERT_GE(points.num, least_points);
  // A mean of 0 would be within the tolerance of few points.
  if (points.num > 12) EXPECT_NEAR(points.MeanChi2(), 3, 4 * std::sqrt(6.0 / points.num));
  EXPECT_GT(as_if_known.MeanChi2(), 1.1 * by_wrist.MeanChi2());
  EXPECT_GT(plain.MeanChi2(), 6 + tolerance);
  EXPECT_LT(by_wrist.RmsMm(), 0.5 * plain.RmsMm());
}

TEST(CellArmLocation, ErrorsAgreeWithTheCovarianceAndAreSmallerThanWithoutTheCorrection) {
  ExpectHonestAndSmallErrors(20, 2);
}
TEST(CellArmLocationNightly, ErrorsAgreeWithTheCovarianceAndAreSmallerThanWithoutTheCorrection) {
  ExpectHonestAndSmallErrors(60, 10);
}

// The uncertainty of each error of the arm, by itself, moves the located object as another value of it does.
TEST(CellArmLocation, TheCovarianceHasTheEffectOfEachErrorOfTheArm) {
  const SeenObject object = SeeBeforeTheWrist(1);
  const Problem& rig = object.scene.rig.problem;
  const auto locate = [&](const Solution& solution) {
    const Outcome<LocatedTarget> located = LocateInCell(rig, solution, object.seen, object.with_errors);
    CHECK(located.ok()) << located.reason();
    return *located;
  };
  const LocatedTarget at_estimate = locate(object.solution);
  const UnknownBlock block = object.solution.covariance.layout.Block(ErrorsBlock(rig.robots[0]));
  ASSERT_GT(block.size, 0);
  constexpr double kStep = 1e-5;  // rad or m.
  for (Eigen::Index i = 0; i < block.size; ++i) {
    Solution uncertain = object.solution;
    uncertain.covariance.matrix.setZero();
    uncertain.covariance.matrix(block.first + i, block.first + i) = kStep * kStep;
    Solution moved = object.solution;
    moved.effects[0][i] += kStep;
    const Tangent6 motion = LocalCoordinates(at_estimate.world_from_target, locate(moved).world_from_target);
    const Eigen::Matrix<double, 6, 6> expected = motion * motion.transpose();
    EXPECT_LT((locate(uncertain).pose_covariance.by_calibration - expected).norm(), 1e-2 * expected.norm())
        << object.solution.covariance.layout.Name(block.first + i);
  }
}

}  // namespace
}  // namespace heba
