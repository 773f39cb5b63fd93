#include "solvers/calibration/influence.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "heba/bundle_adjustment.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

struct Case {
  const char* name;
  BundleOptions::Robot robot = BundleOptions::Robot::kExact;
  double robot_translation_m = 0;
  double robot_rotation_rad = 0;
  const char* loss = "none";
  Setup setup = Setup::kEyeToHand;
  bool has_prior = false;
  // The tolerance is a fraction of the move plus a number of sigmas of the pose.
  double max_relative_error = 0.05;
  double max_sigmas = 0;
};

std::vector<std::optional<CaptureMove>> MovesOf(const PairProblem& problem, const PairSolution& solution,
                                                const BundleOptions& options, LossKind loss) {
  return MoveWithoutEachCapture(HandEyeProblem(problem, options), ProblemSolution(solution), 0, LossOf(loss));
}

class InfluenceTest : public testing::TestWithParam<Case> {};

Outcome<PairSolution> Solve(const TestScene& scene, const std::vector<View>& views, const BundleOptions& options,
                            Setup setup = Setup::kEyeToHand) {
  return RefineHandEye({scene.camera, views, setup}, scene.hand_eye, options);
}

// The truth is a new solve without the capture. The prediction is one Gauss-Newton step with the noise held fixed;
// its error is of second order in the noise, which is small here.
TEST_P(InfluenceTest, PredictsTheMoveWithoutACapture) {
  TestSceneOptions scene_options;
  scene_options.num_captures = 12;
  scene_options.noise_px = 0.06;
  scene_options.robot_translation_m = GetParam().robot_translation_m;
  scene_options.robot_rotation_rad = GetParam().robot_rotation_rad;
  scene_options.setup = GetParam().setup;
  TestScene scene = MakeTestScene(11, scene_options);
  // If the loss is robust, one point is off by 20 sigmas.
  if (std::string(GetParam().loss) != "none") scene.views[3].observations.pixels(0, 7) += 1.2;
  BundleOptions options;
  options.loss = *FindLossKind(GetParam().loss);
  if (GetParam().has_prior) {
    // The prior is as accurate as an estimate from the captures themselves.
    options.camera_prior = CameraPrior{scene.camera.params, {0.3, 0.3, 0.3, 0.3, 1e-3, 1e-2, 1e-4, 1e-4, 1e-2}};
  }
  options.pixel_noise_px = 0.06;
  options.robot = GetParam().robot;
  options.robot_noise = {GetParam().robot_translation_m, GetParam().robot_rotation_rad};
  const Outcome<PairSolution> all = Solve(scene, scene.views, options, GetParam().setup);
  ASSERT_TRUE(all.ok()) << all.reason();
  const std::vector<std::optional<CaptureMove>> moves =
      MovesOf({scene.camera, scene.views, GetParam().setup}, *all, options, *FindLossKind(GetParam().loss));
  ASSERT_EQ(moves.size(), scene.views.size());
  for (size_t i = 0; i < scene.views.size(); ++i) {
    std::vector<View> others = scene.views;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Outcome<PairSolution> without = Solve(scene, others, options, GetParam().setup);
    ASSERT_TRUE(without.ok()) << without.reason();
    const Tangent6 moved =
        LocalCoordinates(all->hand_eye.camera_mount_from_camera, without->hand_eye.camera_mount_from_camera);
    ASSERT_TRUE(moves[i]);
    const Tangent6 wrong = moves[i]->tangent - moved;
    const Tangent6 variances = all->covariance.matrix.diagonal().head<6>();
    EXPECT_LT(wrong.head<3>().norm(), GetParam().max_relative_error * moved.head<3>().norm() +
                                          GetParam().max_sigmas * std::sqrt(variances.head<3>().sum()))
        << i;
    EXPECT_LT(wrong.tail<3>().norm(), GetParam().max_relative_error * moved.tail<3>().norm() +
                                          GetParam().max_sigmas * std::sqrt(variances.tail<3>().sum()))
        << i;
  }
}

INSTANTIATE_TEST_SUITE_P(
    , InfluenceTest,
    testing::Values(Case{"ExactRobot"}, Case{"NoisyRobot", BundleOptions::Robot::kGivenNoise, 1e-4, 2e-4},
                    Case{"Huber", BundleOptions::Robot::kExact, 0, 0, "huber", Setup::kEyeToHand, false, 0.3, 0.1},
                    Case{"EyeInHand", BundleOptions::Robot::kGivenNoise, 1e-4, 2e-4, "none", Setup::kEyeInHand},
                    Case{"Prior", BundleOptions::Robot::kExact, 0, 0, "none", Setup::kEyeToHand, true}),
    [](const auto& test) { return test.param.name; });

TEST(InfluenceOfFewTest, ReturnsNothingForAnIndispensableCapture) {
  TestSceneOptions scene_options;
  scene_options.num_captures = 3;
  scene_options.noise_px = 0.1;
  const TestScene scene = MakeTestScene(5, scene_options);
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  const Outcome<PairSolution> all = Solve(scene, scene.views, options);
  ASSERT_TRUE(all.ok()) << all.reason();
  for (const std::optional<CaptureMove>& move : MovesOf({scene.camera, scene.views}, *all, options, LossKind::kNone)) {
    EXPECT_FALSE(move);
  }
}

// Under the assumed noise the probabilities are uniformly distributed; a capture with a wrong pose has a probability
// close to zero.
TEST(ChanceOfAMoveTest, IsUniformUnlessTheCaptureIsWrong) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.robot = BundleOptions::Robot::kGivenNoise;
  options.robot_noise = {1e-4, 2e-4};
  TestSceneOptions scene_options;
  scene_options.num_captures = 12;
  scene_options.noise_px = 0.1;
  scene_options.robot_translation_m = options.robot_noise.translation_m;
  scene_options.robot_rotation_rad = options.robot_noise.rotation_rad;
  const auto chances = [&](const TestScene& scene) {
    const Outcome<PairSolution> solution = Solve(scene, scene.views, options);
    EXPECT_TRUE(solution.ok()) << solution.reason();
    std::vector<double> all;
    for (const std::optional<CaptureMove>& move :
         MovesOf({scene.camera, scene.views}, *solution, options, LossKind::kNone)) {
      all.push_back(move ? move->p_value : -1);
    }
    return all;
  };
  int num_low = 0;
  int num_all = 0;
  constexpr int kScenes = 50;
  for (uint64_t seed = 1; seed <= kScenes; ++seed) {
    for (const double chance : chances(MakeTestScene(seed, scene_options))) {
      ASSERT_GE(chance, 0);
      num_low += chance < 0.1 ? 1 : 0;
      ++num_all;
    }
  }
  // A tenth of 600 is expected; the tolerance is four sigmas (of 7.3), since the captures of a scene are nearly
  // independent.
  EXPECT_NEAR(num_low, 0.1 * num_all, 30);

  TestScene wrong = MakeTestScene(1, scene_options);
  Rigid3d& pose = wrong.views[5].camera_mount_from_target_mount;
  pose = pose * Rigid3d(ExpRotation(Eigen::Vector3d(0.003, 0, 0)), Eigen::Vector3d(0, 0.001, 0));
  const std::vector<double> with_wrong = chances(wrong);
  EXPECT_LT(with_wrong[5], 1e-6);
  EXPECT_EQ(std::min_element(with_wrong.begin(), with_wrong.end()) - with_wrong.begin(), 5);
}

}  // namespace
}  // namespace heba
