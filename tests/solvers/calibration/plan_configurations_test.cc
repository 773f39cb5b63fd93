// Plans for an arm that reaches the poses in several configurations.
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/bundle_adjustment.h"
#include "heba/capture_plan.h"
#include "heba/data/setup.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"
#include "heba/simulation/scene.h"
#include "tests/support/scene_rng.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// Returns a cell whose camera is in the hand of an arm. `configurations`: those that the arm may take; empty: all.
PlanCell CellOf(const Arm& arm, const std::set<std::string>& configurations) {
  PlanCell cell;
  cell.setup = Setup::kEyeInHand;
  cell.camera = TestCamera();
  cell.points_in_target = GridPoints(6, 5, 0.03);
  cell.z_out = true;
  cell.hand_eye.camera_mount_from_camera.translation = Eigen::Vector3d(0.05, 0.02, 0.06);
  cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0.55, 0.05, 0.02);
  cell.workspace = PlanBox{{0.2, -0.4, 0.25}, {0.9, 0.4, 0.9}};
  cell.postures = [=](const Rigid3d& base_from_gripper) {
    std::vector<PlanPosture> postures;
    const Outcome<std::vector<Eigen::VectorXd>> found = PosturesOf(arm, base_from_gripper);
    if (!found) return postures;
    for (const Eigen::VectorXd& joints : *found) {
      const std::vector<Eigen::Vector3d> origins = OriginsOf(arm, joints);
      const bool is_above =
          std::all_of(origins.begin(), origins.end(), [](const auto& origin) { return origin.z() > 0; });
      if (!is_above) continue;
      const std::string name = NameOf(*ConfigurationOf(arm, joints));
      if (configurations.empty() || configurations.contains(name)) postures.push_back({joints, name});
    }
    return postures;
  };
  cell.posture_distance = [=](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return PostureDistance(arm, a, b);
  };
  return cell;
}

CapturePlan PlanOf(const PlanCell& cell, int count) {
  PlanOptions options;
  options.count = count;
  options.num_candidates = 1000;
  Outcome<CapturePlan> plan = PlanCaptures(cell, options);
  CHECK(plan.ok()) << plan.reason();
  return *std::move(plan);
}

TEST(PlanConfigurations, SecondHalfIsInAnother) {
  const Arm& arm = *FindArm("ur5e");
  const CapturePlan plan = PlanOf(CellOf(arm, {}), 12);
  ASSERT_EQ(plan.captures.size(), 15U);
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    const PlannedCapture& capture = plan.captures[i];
    const PlanPosture& posture = capture.posture;
    EXPECT_LT(DistanceM(BaseFromTip(arm, posture.joints), capture.base_from_gripper), 1e-6);
    EXPECT_EQ(posture.configuration, NameOf(*ConfigurationOf(arm, posture.joints)));
    const bool is_first = i < 6 || capture.repeats;
    EXPECT_EQ(posture.configuration == plan.captures.front().posture.configuration, is_first) << i;
    const PlannedCapture& first = plan.captures[capture.repeats.value_or(i)];
    EXPECT_EQ(posture.joints, first.posture.joints);
  }
}

TEST(PlanConfigurations, FewCapturesAndTheTwoStepMotionHaveOne) {
  const PlanCell cell = CellOf(*FindArm("ur5e"), {});
  PlanOptions two_step;
  two_step.count = 12;
  two_step.is_two_step = true;
  const Outcome<CapturePlan> motion = PlanCaptures(cell, two_step);
  ASSERT_TRUE(motion.ok()) << motion.reason();
  for (const CapturePlan& plan : {PlanOf(cell, 9), *motion}) {
    std::set<std::string> configurations;
    for (const PlannedCapture& capture : plan.captures) configurations.insert(capture.posture.configuration);
    EXPECT_EQ(configurations.size(), 1U);
  }
}

TEST(PlanConfigurations, FormerPosesThatAreNotReachedAreNotTakenAgain) {
  PlanCell cell = CellOf(*FindArm("ur5e"), {});
  const CapturePlan before = PlanOf(cell, 8);
  cell.former_poses = {Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(5, 0, 0))};
  for (size_t i = 0; i < 4; ++i) cell.former_poses.push_back(before.captures[i].base_from_gripper);
  const CapturePlan plan = PlanOf(cell, 5);
  ASSERT_EQ(plan.captures.size(), 8U);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(plan.captures[5 + k].repeats, k + 1);
    EXPECT_EQ(plan.captures[5 + k].posture.joints.size(), 6);
  }
}

// A gripper that stays upright turns about one direction, along which the camera's position is not told; across it is.
TEST(PlanConfigurations, AnUprightGripperLeavesTheHeightOfTheCameraOpen) {
  PlanCell cell;
  cell.setup = Setup::kEyeInHand;
  cell.camera = TestCamera();
  cell.free_intrinsics.clear();
  cell.points_in_target = GridPoints(6, 5, 0.03);
  cell.z_out = true;
  cell.hand_eye.camera_mount_from_camera = Rigid3d(ExpRotation({kPi, 0, 0}), Eigen::Vector3d(0.06, 0.02, 0.01));
  cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0.4, 0.05, 0);
  cell.nearest_reached = [](const Rigid3d& wanted) {
    const Eigen::Vector3d x = wanted.rotation * Eigen::Vector3d::UnitX();
    return Rigid3d(ExpRotation({0, 0, std::atan2(x.y(), x.x())}), wanted.translation);
  };
  const CapturePlan plan = PlanOf(cell, 8);
  for (const PlannedCapture& capture : plan.captures) {
    EXPECT_NEAR((capture.base_from_gripper.rotation * Eigen::Vector3d::UnitZ()).z(), 1, 1e-9);
  }
  ASSERT_EQ(plan.untold.size(), 1U);
  EXPECT_FALSE(plan.untold.front().is_rotation);
  EXPECT_NEAR(std::abs(plan.untold.front().in_mount.z()), 1, 1e-3);
  // The heights of camera and target, of which only the sum is seen.
  EXPECT_NEAR(plan.untold.front().sigma, cell.uncertainty_m / std::sqrt(2), 1e-3);
  EXPECT_NEAR(plan.captures.back().position_m, plan.untold.front().sigma, 1e-3);
}

// The errors of the camera's position in the gripper, and of that of a point half a metre in front of the camera, in
// the base, where the arm is in other configurations than in the first capture; m.
struct CellErrors {
  double camera_m = 0;
  double point_m = 0;
};

// Returns the errors, root mean square over arms whose parameters differ from the nominal ones as those of arms do,
// without or with their estimation.
CellErrors RmsErrors(const Arm& nominal, const PlanCell& cell, const CapturePlan& plan, bool estimates_arm) {
  CellErrors squares;
  int num_points = 0;
  constexpr int kNumArms = 20;
  const Eigen::Vector3d in_camera(0, 0, 0.5);
  const PlanCell anyhow = CellOf(nominal, {});
  for (uint64_t seed = 1; seed <= kNumArms; ++seed) {
    Rng rng = SceneRng(seed);
    const Arm arm = WithChanges(nominal, DrawArmErrors(nominal, {DegToRad(0.05), 3e-4, DegToRad(0.03), 0}, rng));
    PairProblem problem{cell.camera, {}, cell.setup, DesignedShape(cell.points_in_target)};
    for (const PlannedCapture& capture : plan.captures) {
      const Rigid3d true_mount = CameraMountFromTargetMount(cell.setup, BaseFromTip(arm, capture.posture.joints));
      std::optional<View> view =
          SimulateView("", cell.camera, cell.hand_eye, true_mount, cell.points_in_target, 0.1, rng);
      CHECK(view.has_value());
      view->camera_mount_from_target_mount = CameraMountFromTargetMount(cell.setup, capture.base_from_gripper);
      view->effect = MakeArmEffect(nominal, capture.posture.joints, Rigid3d());
      problem.views.push_back(std::move(*view));
    }
    BundleOptions bundle;
    bundle.loss = LossKind::kNone;
    bundle.free_intrinsics = {};
    bundle.robot = BundleOptions::Robot::kEstimatedNoise;
    if (estimates_arm) {
      bundle.effects = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
    }
    const Outcome<PairSolution> solution = RefineHandEye(problem, cell.hand_eye, bundle);
    CHECK(solution.ok()) << solution.reason();
    const Rigid3d& estimate = solution->hand_eye.camera_mount_from_camera;
    const Rigid3d& truth = cell.hand_eye.camera_mount_from_camera;
    squares.camera_m += (estimate.translation - truth.translation).squaredNorm() / kNumArms;
    Eigen::VectorXd found = Eigen::VectorXd::Zero(nominal.num_params());
    for (size_t k = 0; estimates_arm && k < bundle.effects->effects.size(); ++k) {
      found[bundle.effects->effects[k].index] = solution->effects[k];
    }
    const Arm estimated = WithChanges(nominal, found);
    for (const PlannedCapture& capture : plan.captures) {
      for (const PlanPosture& posture : anyhow.postures(capture.base_from_gripper)) {
        if (posture.configuration == plan.captures.front().posture.configuration) continue;
        squares.point_m += (BaseFromTip(estimated, posture.joints) * (estimate * in_camera) -
                            BaseFromTip(arm, posture.joints) * (truth * in_camera))
                               .squaredNorm();
        ++num_points;
      }
    }
  }
  return {std::sqrt(squares.camera_m), std::sqrt(squares.point_m / num_points)};
}

TEST(PlanConfigurations, ErrorsOfTheArmCountLess) {
  const Arm& arm = *FindArm("ur5e");
  const PlanCell cell = CellOf(arm, {});
  for (const int count : {12, 18}) {
    const CapturePlan two = PlanOf(cell, count);
    const PlanCell in_one = CellOf(arm, {two.captures.front().posture.configuration});
    const CapturePlan one = PlanOf(in_one, count);
    EXPECT_LT(RmsErrors(arm, cell, two, false).camera_m, 0.8 * RmsErrors(arm, in_one, one, false).camera_m) << count;
    // An arm that is estimated is known where it was not calibrated; the camera's pose pays a little for it.
    const CellErrors of_two = RmsErrors(arm, cell, two, true);
    const CellErrors of_one = RmsErrors(arm, in_one, one, true);
    EXPECT_LT(of_two.point_m, 0.7 * of_one.point_m) << count;
    EXPECT_LT(of_two.camera_m, 2 * of_one.camera_m) << count;
    RecordProperty("mm_" + std::to_string(count),
                   std::to_string(1000 * of_two.point_m) + " " + std::to_string(1000 * of_one.point_m));
  }
}

}  // namespace
}  // namespace heba
