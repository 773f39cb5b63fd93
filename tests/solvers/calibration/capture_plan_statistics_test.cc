// Planned poses against those that people take, in simulated cells whose rough set-up is wrong by 30 mm and 5 deg.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/median.h"
#include "heba/bundle_adjustment.h"
#include "heba/capture_plan.h"
#include "heba/data/setup.h"
#include "heba/simulation/scene.h"
#include "tests/support/scene_rng.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

using Side = heba::Setup;

PlanCell CellOf(Side setup) {
  PlanCell cell;
  cell.setup = setup;
  cell.camera = TestCamera();
  cell.points_in_target = GridPoints(6, 5, 0.03);
  cell.free_intrinsics = {};
  cell.robot_noise = {2e-4, DegToRad(0.02)};
  cell.z_out = true;
  if (setup == Side::kEyeInHand) {
    cell.hand_eye.camera_mount_from_camera.translation = Eigen::Vector3d(0.05, 0.02, 0.06);
    cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0.55, 0.05, 0.02);
    cell.workspace = PlanBox{{0.2, -0.4, 0.25}, {0.9, 0.4, 0.9}};
  } else {
    cell.hand_eye.camera_mount_from_camera =
        Rigid3d(ExpRotation(Eigen::Vector3d(kPi, 0, 0)), Eigen::Vector3d(0.5, 0, 1.2));
    cell.hand_eye.target_mount_from_target.translation = Eigen::Vector3d(0, 0, 0.08);
    cell.workspace = PlanBox{{0.2, -0.4, 0.2}, {0.9, 0.4, 0.8}};
  }
  return cell;
}

HandEye WrongBy30MmAnd5Deg(const HandEye& truth, Rng& rng) {
  const auto wrong = [&](const Rigid3d& pose) {
    Tangent6 error;
    error << 0.03 * rng.NormalVector3().normalized(), DegToRad(5) * rng.NormalVector3().normalized();
    return Retract(pose, error);
  };
  return {wrong(truth.camera_mount_from_camera), wrong(truth.target_mount_from_target)};
}

// A session: the error of a located target after it, m, and the share of poses in which the target is seen.
struct PlannedSession {
  double error_m = 0;
  double seen = 0;
};

// Takes the captures at these poses in the true cell, calibrates, and locates targets at `places`, poses of the target
// in the camera. A calibration that fails errs infinitely.
PlannedSession TakeSession(const PlanCell& truth, const std::vector<Rigid3d>& poses, const std::vector<Rigid3d>& places,
                           Rng& rng) {
  PairProblem problem{truth.camera, {}, truth.setup, DesignedShape(truth.points_in_target)};
  const SimulatedTarget target{truth.points_in_target, truth.z_out};
  PlannedSession session;
  for (const Rigid3d& pose : poses) {
    const Rigid3d mount = CameraMountFromTargetMount(truth.setup, pose);
    if (!IsVisible(truth.camera, CameraFromTarget(truth.hand_eye, mount), target, 1)) continue;
    session.seen += 1.0 / static_cast<double>(poses.size());
    std::optional<View> view =
        SimulateView("", truth.camera, truth.hand_eye, mount, truth.points_in_target, truth.pixel_noise_px, rng);
    view->camera_mount_from_target_mount = CameraMountFromTargetMount(
        truth.setup, WithRobotNoise(pose, truth.robot_noise.rotation_rad, truth.robot_noise.translation_m, rng));
    problem.views.push_back(std::move(*view));
  }
  BundleOptions bundle;
  bundle.loss = LossKind::kNone;
  bundle.free_intrinsics = {};
  bundle.robot = BundleOptions::Robot::kGivenNoise;
  bundle.robot_noise = truth.robot_noise;
  bundle.pixel_noise_px = truth.pixel_noise_px;
  const Outcome<PairSolution> solution = RefineHandEye(problem, truth.hand_eye, bundle);
  session.error_m = std::numeric_limits<double>::infinity();
  if (!solution) return session;
  const Rigid3d change = Inverse(truth.hand_eye.camera_mount_from_camera) * solution->hand_eye.camera_mount_from_camera;
  double squares_m2 = 0;
  for (const Rigid3d& place : places) {
    squares_m2 += (change * place.translation - place.translation).squaredNorm() / static_cast<double>(places.size());
  }
  session.error_m = std::sqrt(squares_m2);
  return session;
}

std::vector<Rigid3d> PosesOf(const CapturePlan& plan) {
  std::vector<Rigid3d> poses;
  for (const PlannedCapture& capture : plan.captures) poses.push_back(capture.base_from_gripper);
  return poses;
}

// The 17 moves of easy_handeye: turns by 25 and 12.5 deg about the axes of the camera, and steps of 5 cm, around one
// pose.
std::vector<Rigid3d> HabitualPoses(const Rigid3d& middle) {
  std::vector<Rigid3d> poses = {middle};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (const double turn_deg : {25.0, -25.0, 12.5, -12.5}) {
      if (axis == 2 && std::abs(turn_deg) < 20) continue;
      Tangent6 turn = Tangent6::Zero();
      turn[3 + axis] = DegToRad(turn_deg);
      poses.push_back(Retract(middle, turn));
    }
    for (const double step_m : {0.05, -0.05}) {
      Tangent6 step = Tangent6::Zero();
      step[axis] = step_m;
      poses.push_back(Retract(middle, step));
    }
  }
  return poses;
}

double RootMeanSquare(const std::vector<double>& errors) {
  double sum = 0;
  for (const double error : errors) sum += error * error / static_cast<double>(errors.size());
  return std::sqrt(sum);
}

class CapturePlanStatisticsTest : public testing::TestWithParam<Side> {};

TEST_P(CapturePlanStatisticsTest, PlannedPosesTellMore) {
  const PlanCell truth = CellOf(GetParam());
  const bool is_in_hand = GetParam() == Side::kEyeInHand;
  constexpr int kNumSeeds = 20;
  constexpr int kNumRandom = 10;
  constexpr int kNumSessions = 12;
  std::vector<double> planned_m;
  std::vector<double> random_m;
  std::vector<double> fifteen_m;
  std::vector<double> habitual_m;
  double seen = 0;
  double predicted_m2 = 0;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    Rng rng = SceneRng(seed);
    PlanCell rough = truth;
    rough.hand_eye = WrongBy30MmAnd5Deg(truth.hand_eye, rng);
    PlanOptions options;
    options.count = 10;
    options.num_revisits = 0;
    options.seed = seed;
    const Outcome<CapturePlan> plan = PlanCaptures(rough, options);
    ASSERT_TRUE(plan.ok()) << plan.reason();
    std::vector<Rigid3d> places;
    for (const PlannedCapture& capture : plan->captures) places.push_back(capture.camera_from_target);
    for (int session = 0; session < kNumSessions; ++session) {
      const PlannedSession planned = TakeSession(truth, PosesOf(*plan), places, rng);
      planned_m.push_back(planned.error_m);
      seen += planned.seen / (kNumSeeds * kNumSessions);
    }
    predicted_m2 += std::pow(plan->captures.back().target_m, 2) / kNumSeeds;
    for (int k = 0; k < kNumRandom; ++k) {
      PlanOptions by_chance = options;
      by_chance.seed = 1000 * seed + static_cast<uint64_t>(k);
      by_chance.num_candidates = by_chance.count;
      const Outcome<CapturePlan> ten = PlanCaptures(rough, by_chance);
      by_chance.count = by_chance.num_candidates = 15;
      const Outcome<CapturePlan> fifteen = PlanCaptures(rough, by_chance);
      ASSERT_TRUE(ten.ok() && fifteen.ok());
      random_m.push_back(TakeSession(truth, PosesOf(*ten), places, rng).error_m);
      fifteen_m.push_back(TakeSession(truth, PosesOf(*fifteen), places, rng).error_m);
    }
    // Around a pose in which the target is in the middle of the image.
    const PlannedCapture& middle = *std::min_element(
        plan->captures.begin(), plan->captures.end(), [](const PlannedCapture& a, const PlannedCapture& b) {
          const auto off = [](const PlannedCapture& c) { return c.camera_from_target.translation.head<2>().norm(); };
          return off(a) < off(b);
        });
    for (int session = 0; session < kNumSessions; ++session) {
      habitual_m.push_back(TakeSession(truth, HabitualPoses(middle.base_from_gripper), places, rng).error_m);
    }
  }
  const double planned_median_m = Median(planned_m);
  const double ratio_random = planned_median_m / Median(random_m);
  const double ratio_fifteen = planned_median_m / Median(fifteen_m);
  const double ratio_habit = planned_median_m / Median(habitual_m);
  const double predicted = std::sqrt(predicted_m2) / RootMeanSquare(planned_m);
  std::cout << (is_in_hand ? "in hand" : "to hand") << ": planned 10 " << 1000 * planned_median_m << " mm, random 10 "
            << 1000 * Median(random_m) << ", random 15 " << 1000 * Median(fifteen_m) << ", 17 habitual "
            << 1000 * Median(habitual_m) << "; ratios " << ratio_random << ", " << ratio_fifteen << ", " << ratio_habit
            << "; seen " << seen << ", predicted / RMS " << predicted << "\n";
  RecordProperty("ratio_random", std::to_string(ratio_random));
  EXPECT_LE(ratio_random, is_in_hand ? 0.85 : 0.7);
  EXPECT_LE(ratio_fifteen, 1.05);
  EXPECT_LE(ratio_habit, is_in_hand ? 0.25 : 0.35);
  EXPECT_GE(seen, 0.95);
  EXPECT_GE(predicted, 0.8);
  EXPECT_LE(predicted, 1.25);
}

INSTANTIATE_TEST_SUITE_P(Cells, CapturePlanStatisticsTest, testing::Values(Side::kEyeInHand, Side::kEyeToHand),
                         [](const auto& test) { return test.param == Side::kEyeInHand ? "in_hand" : "to_hand"; });

}  // namespace
}  // namespace heba
