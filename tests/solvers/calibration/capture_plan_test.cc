#include "heba/capture_plan.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/median.h"
#include "heba/base/rng.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/setup.h"
#include "heba/simulation/scene.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// A cell of a robot arm's size, with a camera in its hand or beside it.
PlanCell CellOf(Setup setup) {
  PlanCell cell;
  cell.setup = setup;
  cell.camera = TestCamera();
  cell.points_in_target = GridPoints(6, 5, 0.03);
  cell.free_intrinsics = {};
  cell.robot_noise = {2e-4, DegToRad(0.02)};
  const Eigen::Quaterniond down = ExpRotation(Eigen::Vector3d(kPi, 0, 0));
  if (setup == heba::Setup::kEyeInHand) {
    cell.hand_eye.camera_mount_from_camera.translation = Eigen::Vector3d(0.05, 0.02, 0.06);
    cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0.55, 0.05, 0.02);
    cell.workspace = PlanBox{{0.2, -0.4, 0.25}, {0.9, 0.4, 0.9}};
  } else {
    cell.hand_eye.camera_mount_from_camera = Rigid3d(down, Eigen::Vector3d(0.5, 0, 1.2));
    cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0, 0, 0.08);
    cell.workspace = PlanBox{{0.2, -0.4, 0.2}, {0.9, 0.4, 0.8}};
  }
  // The target is seen from its front.
  cell.z_out = true;
  return cell;
}

double LocatedAfter(const CapturePlan& plan, size_t count) { return plan.captures[count - 1].target_m; }

TEST(CapturePlanTest, StaysInTheWorkspaceAndSeesTheTarget) {
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    const PlanCell cell = CellOf(setup);
    const Outcome<CapturePlan> plan = PlanCaptures(cell, {});
    ASSERT_TRUE(plan.ok()) << plan.reason();
    ASSERT_EQ(plan->captures.size(), 18U);
    const SimulatedTarget target{cell.points_in_target, cell.z_out};
    Rng rng(7);
    int num_seen = 0;
    int num_all = 0;
    for (size_t i = 0; i < plan->captures.size(); ++i) {
      const PlannedCapture& capture = plan->captures[i];
      EXPECT_TRUE(cell.workspace->Contains(capture.base_from_gripper.translation));
      EXPECT_TRUE(IsVisible(cell.camera, capture.camera_from_target, target, 1));
      if (i >= 15) {
        ASSERT_EQ(capture.repeats, i - 15);
        EXPECT_EQ(DistanceM(capture.base_from_gripper, plan->captures[i - 15].base_from_gripper), 0);
        continue;
      }
      EXPECT_FALSE(capture.repeats);
      // A set-up that is off by 30 mm and 5 deg in random directions sees it, too.
      const Rigid3d mount = CameraMountFromTargetMount(setup, capture.base_from_gripper);
      for (int draw = 0; draw < 20; ++draw) {
        const auto off = [&](const Rigid3d& pose) {
          Tangent6 error;
          error << 0.03 * rng.NormalVector3().normalized(), DegToRad(5) * rng.NormalVector3().normalized();
          return Retract(pose, error);
        };
        const HandEye rough{off(cell.hand_eye.camera_mount_from_camera), off(cell.hand_eye.target_mount_from_target)};
        num_seen += IsVisible(cell.camera, CameraFromTarget(rough, mount), target, 0) ? 1 : 0;
        ++num_all;
      }
    }
    EXPECT_GE(static_cast<double>(num_seen), 0.95 * num_all);
    // Each capture leaves less unknown.
    for (size_t i = 1; i < 15; ++i) EXPECT_LT(LocatedAfter(*plan, i + 1), LocatedAfter(*plan, i));
    EXPECT_LT(plan->order_by_pose, 0.5);
  }
}

// The expected error is that of calibrations from such captures.
TEST(CapturePlanTest, ExpectsTheErrorsThatCalibrationsHave) {
  const PlanCell cell = CellOf(heba::Setup::kEyeToHand);
  PlanOptions options;
  options.count = 10;
  options.num_revisits = 0;
  const Outcome<CapturePlan> plan = PlanCaptures(cell, options);
  ASSERT_TRUE(plan.ok()) << plan.reason();
  double squares_m2 = 0;
  constexpr int kNumSeeds = 60;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    Rng rng(seed);
    PairProblem problem{cell.camera, {}, cell.setup, DesignedShape(cell.points_in_target)};
    for (const PlannedCapture& capture : plan->captures) {
      std::optional<View> view = SimulateView("", cell.camera, cell.hand_eye, capture.base_from_gripper,
                                              cell.points_in_target, cell.pixel_noise_px, rng);
      ASSERT_TRUE(view);
      view->camera_mount_from_target_mount =
          WithRobotNoise(capture.base_from_gripper, cell.robot_noise.rotation_rad, cell.robot_noise.translation_m, rng);
      problem.views.push_back(std::move(*view));
    }
    BundleOptions bundle;
    bundle.loss = LossKind::kNone;
    bundle.free_intrinsics = {};
    bundle.robot = BundleOptions::Robot::kGivenNoise;
    bundle.robot_noise = cell.robot_noise;
    bundle.pixel_noise_px = cell.pixel_noise_px;
    const Outcome<PairSolution> solution = RefineHandEye(problem, cell.hand_eye, bundle);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    squares_m2 +=
        std::pow(DistanceM(solution->hand_eye.camera_mount_from_camera, cell.hand_eye.camera_mount_from_camera), 2);
  }
  const double rms_m = std::sqrt(squares_m2 / kNumSeeds);
  EXPECT_NEAR(plan->captures.back().position_m / rms_m, 1, 0.2);
}

// Ten planned poses tell more than ten that are drawn from the same candidates: those of a plan of one, two, ... poses
// with other seeds.
TEST(CapturePlanTest, IsBetterThanPosesByChance) {
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    const PlanCell cell = CellOf(setup);
    PlanOptions options;
    options.count = 10;
    options.num_revisits = 0;
    const Outcome<CapturePlan> plan = PlanCaptures(cell, options);
    ASSERT_TRUE(plan.ok()) << plan.reason();
    std::vector<double> by_chance_m;
    for (uint64_t seed = 1; seed <= 15; ++seed) {
      PlanOptions random = options;
      random.seed = seed;
      random.num_candidates = options.count;  // There is no choice.
      const Outcome<CapturePlan> other = PlanCaptures(cell, random);
      ASSERT_TRUE(other.ok()) << other.reason();
      by_chance_m.push_back(other->captures.back().position_m);
    }
    EXPECT_LT(plan->captures.back().position_m, 0.9 * Median(by_chance_m));
  }
}

TEST(CapturePlanTest, PlansTheTwoStepMotion) {
  PlanCell cell = CellOf(heba::Setup::kEyeToHand);
  PlanOptions options;
  options.count = 12;
  options.is_two_step = true;
  const Outcome<CapturePlan> plan = PlanCaptures(cell, options);
  ASSERT_TRUE(plan.ok()) << plan.reason();
  ASSERT_EQ(plan->captures.size(), 12U);
  EXPECT_EQ(plan->captures[0].role, CaptureRole::kHome);
  EXPECT_EQ(plan->captures[1].role, CaptureRole::kTranslateX);
  EXPECT_EQ(plan->captures[2].role, CaptureRole::kTranslateY);
  for (const PlannedCapture& capture : plan->captures) {
    EXPECT_TRUE(cell.workspace->Contains(capture.base_from_gripper.translation));
  }
}

TEST(CapturePlanTest, KeepsOutAndSaysWhyItFinds) {
  PlanCell cell = CellOf(heba::Setup::kEyeInHand);
  const PlanBox box{{0.5, -1, 0}, {0.7, 1, 0.6}};
  cell.keep_out = {box};
  const Outcome<CapturePlan> plan = PlanCaptures(cell, {});
  ASSERT_TRUE(plan.ok()) << plan.reason();
  for (const PlannedCapture& capture : plan->captures) {
    EXPECT_FALSE(box.Contains(capture.base_from_gripper.translation));
    EXPECT_FALSE(box.Contains((capture.base_from_gripper * cell.hand_eye.camera_mount_from_camera).translation));
  }
  cell.workspace = PlanBox{{5, 5, 5}, {6, 6, 6}};
  const Outcome<CapturePlan> none = PlanCaptures(cell, {});
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.failure().code, "few_planned");
  const auto number = [&](const std::string& key) {
    for (const auto& [name, value] : none.failure().numbers) {
      if (name == key) return value;
    }
    return -1.0;
  };
  EXPECT_EQ(number("found"), 0);
  EXPECT_GT(number("outside"), 0.9 * number("drawn"));
}

// Before the session a target is known to what the rough set-up leaves; with an earlier session, to less.
TEST(CapturePlanTest, AddsToWhatIsKnown) {
  PlanCell cell = CellOf(heba::Setup::kEyeToHand);
  PlanOptions options;
  options.count = 4;
  options.num_revisits = 0;
  const Outcome<CapturePlan> first = PlanCaptures(cell, options);
  ASSERT_TRUE(first.ok()) << first.reason();
  EXPECT_GT(first->target_before_m, 0.03);
  UnknownLayout layout;
  layout.AddPose("hand_eye");
  layout.AddPose("board");
  cell.known = {layout, Eigen::VectorXd::Constant(12, 1e-8).asDiagonal()};
  const Outcome<CapturePlan> second = PlanCaptures(cell, options);
  ASSERT_TRUE(second.ok()) << second.reason();
  EXPECT_LT(second->target_before_m, 1e-3);
  EXPECT_LT(second->captures.back().target_m, first->captures.back().target_m);
}

}  // namespace
}  // namespace heba
