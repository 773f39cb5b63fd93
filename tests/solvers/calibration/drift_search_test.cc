#include "solvers/calibration/drift_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kNoisePx = 0.1;
constexpr double kRobotM = 1e-4;
constexpr double kRobotRad = DegToRad(0.01);

TestSceneOptions SceneWith(Setup setup, int num_captures = 20) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = num_captures;
  options.noise_px = kNoisePx;
  options.robot_translation_m = kRobotM;
  options.robot_rotation_rad = kRobotRad;
  return options;
}

// Takes the images again at the exact poses of the robot, with a body that moves.
void AddDrift(const Drift& drift, const TestSceneOptions& options, uint64_t seed, TestScene* scene) {
  Rng rng(seed);
  const size_t num_captures = scene->views.size();
  for (size_t i = 0; i < num_captures; ++i) {
    HandEye then = scene->hand_eye;
    const Tangent6 back = -RemainingShare(drift, i, num_captures) * drift.change;
    const bool is_camera = drift.body.kind == DriftBody::Kind::kCamera;
    Rigid3d& body = is_camera ? then.camera_mount_from_camera : then.target_mount_from_target;
    body = Retract(body, back);
    std::optional<View> view = SimulateView("", scene->camera, then, scene->pairs[i].camera_mount_from_target_mount,
                                            options.points, options.noise_px, rng);
    ASSERT_TRUE(view);
    scene->views[i].observations = view->observations;
  }
}

Drift LinearDrift(Setup setup, DriftSide side, double rotation_deg, double translation_m) {
  Drift drift;
  drift.body = BodyOn(setup, side);
  drift.change << translation_m, -translation_m, 0, 0, DegToRad(rotation_deg), 0;
  return drift;
}

struct Solved {
  Problem problem;
  Solution solution;
  CaptureTimes times;
};

Solved Solve(const TestScene& scene, const TestSceneOptions& scene_options) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  const PairProblem problem{scene.camera, scene.views, scene_options.setup, DesignedShape(scene_options.points)};
  const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
  EXPECT_TRUE(solution.ok()) << solution.reason();
  Solved solved{HandEyeProblem(problem, options), ProblemSolution(*solution), {{}, scene.views.size()}};
  for (size_t i = 0; i < scene.views.size(); ++i) solved.times.places.push_back(i);
  return solved;
}

// With the poses that WithoutDrift returns, the images of a body that moves agree with the pose that it has at the end.
TEST(DriftTest, WithoutDriftTakesItBack) {
  for (const heba::Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
    for (const DriftSide side : {DriftSide::kHand, DriftSide::kWorld}) {
      TestSceneOptions options = SceneWith(setup);
      options.noise_px = 0;
      TestScene scene = MakeTestScene(1, options);
      const Drift drift = LinearDrift(setup, side, 0.1, 1e-3);
      AddDrift(drift, options, 1, &scene);
      const auto largest_error_px = [&](bool is_corrected) {
        double largest = 0;
        for (size_t i = 0; i < scene.views.size(); ++i) {
          View view = scene.views[i];
          view.camera_mount_from_target_mount = scene.pairs[i].camera_mount_from_target_mount;
          if (is_corrected) {
            view.camera_mount_from_target_mount =
                WithoutDrift(view.camera_mount_from_target_mount, drift, RemainingShare(drift, i, scene.views.size()),
                             scene.hand_eye.camera_mount_from_camera, scene.hand_eye.target_mount_from_target);
          }
          const auto errors = ReprojectionErrors(scene.hand_eye, scene.camera, {view});
          largest = std::max(largest, errors ? errors->RmsPx().value_or(1e9) : 1e9);
        }
        return largest;
      };
      EXPECT_GT(largest_error_px(false), 0.5);
      EXPECT_LT(largest_error_px(true), 1e-6);
    }
  }
}

// In a mixed order, white noise is an honest null: a drift of .1 deg is found, on its side and of its size, and none is
// found where there is none.
TEST(DriftSearchTest, FindsADriftAndNothingElse) {
  constexpr int kNumSeeds = 40;
  int num_found = 0;
  int num_right_sides = 0;
  int num_false = 0;
  int num_tried = 0;
  double squares = 0;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const heba::Setup setup = seed % 2 == 0 ? Setup::kEyeToHand : Setup::kEyeInHand;
    const DriftSide side = seed % 4 < 2 ? DriftSide::kHand : DriftSide::kWorld;
    const TestSceneOptions options = SceneWith(setup);
    TestScene scene = MakeTestScene(seed, options);
    const Solved still = Solve(scene, options);
    const DriftSearch of_still = FindDrift(still.problem, still.solution, still.times, {still.problem, still.times});
    if (of_still.unseen) continue;  // The order follows the poses by chance.
    ++num_tried;
    num_false += of_still.found ? 1 : 0;
    const Drift drift = LinearDrift(setup, side, 0.1, 5e-4);
    AddDrift(drift, options, 1000 + seed, &scene);
    const Solved moved = Solve(scene, options);
    const DriftSearch search = FindDrift(moved.problem, moved.solution, moved.times, {moved.problem, moved.times});
    if (!search.found) continue;
    ++num_found;
    EXPECT_EQ(search.found->evidence, DriftEvidence::kOrder);
    if (search.found->body != drift.body || search.found->form != DriftForm::kLinear) continue;
    ++num_right_sides;
    const Tangent6 error = search.found->change - drift.change;
    squares += error.dot(search.found->covariance.ldlt().solve(error));
  }
  ASSERT_GE(num_tried, 3 * kNumSeeds / 4);
  EXPECT_LE(num_false, 2);
  EXPECT_GE(num_found, num_tried - 1);
  EXPECT_GE(num_right_sides, 3 * num_tried / 4);
  // The noise of the robot was estimated with the drift in it, which makes the covariance too large.
  EXPECT_LT(squares / (6 * num_right_sides), 1.3);
}

// A knock between two captures is told from a creep, with its place.
TEST(DriftSearchTest, FindsAStep) {
  int num_right = 0;
  constexpr uint64_t kNumSeeds = 10;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const TestSceneOptions options = SceneWith(Setup::kEyeToHand);
    TestScene scene = MakeTestScene(seed, options);
    Drift drift = LinearDrift(options.setup, DriftSide::kWorld, 0.15, 1e-3);
    drift.form = DriftForm::kStep;
    drift.capture = 8;
    AddDrift(drift, options, 1000 + seed, &scene);
    const Solved solved = Solve(scene, options);
    const DriftSearch search = FindDrift(solved.problem, solved.solution, solved.times, {solved.problem, solved.times});
    if (search.found && search.found->form == DriftForm::kStep && search.found->capture == drift.capture) ++num_right;
  }
  EXPECT_GE(num_right, 8);
}

// Poses along a path, whose errors vary smoothly with the pose: a drift cannot be told from them, which is said. The
// first three poses at the end show it.
TEST(DriftSearchTest, OnlyRevisitsTellADriftFromSmoothErrors) {
  int num_found = 0;
  int num_false = 0;
  int num_unseen = 0;
  constexpr uint64_t kNumSeeds = 20;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    TestSceneOptions options = SceneWith(Setup::kEyeToHand, 24);
    options.robot_translation_m = 0;
    options.robot_rotation_rad = 0;
    TestScene scene = MakeTestScene(seed, options);
    // The captures in the order of their position along a path, and errors that are a function of it.
    const auto along = [](const Rigid3d& pose) { return pose.translation.sum(); };
    std::sort(scene.pairs.begin(), scene.pairs.end(), [&](const PosePair& a, const PosePair& b) {
      return along(a.camera_mount_from_target_mount) < along(b.camera_mount_from_target_mount);
    });
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Eigen::Matrix<double, 6, 2> slopes;
    for (double& slope : slopes.reshaped()) slope = normal(random);
    const double middle = along(scene.pairs[scene.pairs.size() / 2].camera_mount_from_target_mount);
    const auto reported_at = [&](const Rigid3d& exact) {
      const double place = (along(exact) - middle) / 0.2;
      Tangent6 error = slopes * Eigen::Vector2d(place, std::sin(2 * place));
      error.head<3>() *= 3e-4;
      error.tail<3>() *= DegToRad(0.03);
      return Retract(exact, error);
    };
    const auto search = [&](TestScene with, const Drift& drift) {
      for (size_t i = 0; i < with.pairs.size(); ++i) {
        with.views[i].camera_mount_from_target_mount = reported_at(with.pairs[i].camera_mount_from_target_mount);
      }
      AddDrift(drift, options, seed, &with);
      const Solved solved = Solve(with, options);
      return FindDrift(solved.problem, solved.solution, solved.times, {solved.problem, solved.times});
    };
    const Drift none;
    const Drift drift = LinearDrift(options.setup, DriftSide::kWorld, 0.15, 1e-3);
    const DriftSearch without_revisits = search(scene, drift);
    num_unseen += without_revisits.unseen && !without_revisits.found ? 1 : 0;
    for (size_t k = 0; k < 3; ++k) {
      scene.views.push_back(scene.views[k]);
      scene.pairs.push_back(scene.pairs[k]);
    }
    num_false += search(scene, none).found ? 1 : 0;
    const DriftSearch found = search(scene, drift);
    num_found += found.found && found.found->evidence == DriftEvidence::kRevisits ? 1 : 0;
  }
  EXPECT_GE(num_unseen, 18);
  EXPECT_LE(num_false, 1);
  EXPECT_GE(num_found, 18);
}

TEST(OrderByPoseTest, TellsAPathFromAMixedOrder) {
  std::vector<Rigid3d> path;
  std::vector<size_t> places;
  for (size_t i = 0; i < 30; ++i) {
    Rigid3d pose;
    pose.translation = Eigen::Vector3d(0.01 * static_cast<double>(i), 0.05 * std::sin(0.3 * static_cast<double>(i)), 0);
    path.push_back(pose);
    places.push_back(i);
  }
  EXPECT_GT(OrderByPose(path, places), 0.9);
  std::vector<size_t> mixed = places;
  std::mt19937_64 random(3);
  std::shuffle(mixed.begin(), mixed.end(), random);
  EXPECT_LT(OrderByPose(path, mixed), 0.3);
  EXPECT_EQ(OrderByPose({path[0], path[1]}, {0, 1}), 0);
}

}  // namespace
}  // namespace heba
