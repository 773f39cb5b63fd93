#include "heba/refinement.h"

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/data/solution.h"
#include "tests/support/cell_scenes.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {

using MakeCell = std::function<CellScene(uint64_t, const CellSceneSetting&)>;
struct CellKind {
  std::string name;
  MakeCell make;
};
void PrintTo(const CellKind& kind, std::ostream* stream) { *stream << kind.name; }

// Returns poses that are some millimetres and tenths of a degree from the truth.
CellPoses Perturbed(const CellPoses& truth, Rng& rng) {
  CellPoses poses = truth;
  const auto move = [&](Rigid3d& pose) {
    Tangent6 step;
    step << 5e-3 * rng.NormalVector3(), 5e-3 * rng.NormalVector3();
    pose = Retract(pose, step);
  };
  for (Rigid3d& pose : poses.mount_from_camera) move(pose);
  for (Rigid3d& pose : poses.mount_from_target) move(pose);
  for (size_t r = 1; r < poses.world_from_base.size(); ++r) move(poses.world_from_base[r]);
  return poses;
}

class CellAdjustmentTest : public testing::TestWithParam<CellKind> {};
INSTANTIATE_TEST_SUITE_P(Rigs, CellAdjustmentTest,
                         testing::Values(CellKind{"Mixed", MixedCell}, CellKind{"FourCameras", FourCameraCell},
                                         CellKind{"TwoArms", TwoArmCell}),
                         [](const testing::TestParamInfo<CellKind>& test) { return test.param.name; });

TEST_P(CellAdjustmentTest, RecoversNoiseFreeCell) {
  const CellScene scene = GetParam().make(1, {20, 0, {0, 0, 0}});
  Rng rng(2);
  AdjustmentOptions options;
  options.robot = BundleOptions::Robot::kExact;
  const Outcome<Solution> solution = RefineProblem(scene.problem, Perturbed(scene.truth, rng), options);
  ASSERT_TRUE(solution) << solution.reason();
  constexpr double kRoundOff = 1e-8;
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    EXPECT_THAT(solution->poses.mount_from_camera[c],
                IsNearPose(scene.truth.mount_from_camera[c], kRoundOff, kRoundOff));
    EXPECT_NEAR(solution->cameras[c].params[0], scene.problem.cameras[c].camera.params[0], 1e-4);
  }
  for (size_t t = 0; t < scene.problem.targets.size(); ++t) {
    EXPECT_THAT(solution->poses.mount_from_target[t],
                IsNearPose(scene.truth.mount_from_target[t], kRoundOff, kRoundOff));
  }
  for (size_t r = 0; r < scene.problem.robots.size(); ++r) {
    EXPECT_THAT(solution->poses.world_from_base[r], IsNearPose(scene.truth.world_from_base[r], kRoundOff, kRoundOff));
  }
}

// Every pixel and robot sigma is found within 4 of its own standard deviations.
TEST_P(CellAdjustmentTest, EstimatesNoiseOfCamerasAndArms) {
  CellSceneSetting setting;
  setting.num_captures = 40;
  CellScene scene = GetParam().make(3, setting);
  // The first camera is noisier than the others.
  Rng rng(4);
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.camera != 0) continue;
      for (double& pixel : image.observations.pixels.reshaped()) pixel += 0.3 * rng.Normal();
    }
  }
  const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
  ASSERT_TRUE(solution) << solution.reason();
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    int num_points = 0;
    for (const ProblemCapture& capture : scene.problem.captures) {
      for (const ProblemImage& image : capture.images) num_points += image.camera == c ? image.observations.size() : 0;
    }
    const double sigma_px = c == 0 ? std::hypot(0.3, setting.noise_px) : setting.noise_px;
    EXPECT_NEAR(solution->pixel_sigmas_px[c], sigma_px, 4 * sigma_px / std::sqrt(4.0 * num_points)) << c;
  }
  for (size_t r = 0; r < scene.problem.robots.size(); ++r) {
    ASSERT_TRUE(solution->robot_noise[r] && solution->robot_noise_stddev[r]);
    EXPECT_NEAR(solution->robot_noise[r]->translation_m, setting.robot_noise.translation_m,
                4 * solution->robot_noise_stddev[r]->translation_m);
    EXPECT_NEAR(solution->robot_noise[r]->rotation_rad, setting.robot_noise.rotation_rad,
                4 * solution->robot_noise_stddev[r]->rotation_rad);
  }
}

// Two fixed cameras, of which the left one sees the target on the gripper and both see one beside the arm: the
// intrinsics of the right camera cannot be determined.
CellScene CellWithStillCamera(uint64_t seed) {
  Rng rng(seed);
  const CellSceneSetting setting{25, 0.1, {}};
  CellScene scene;
  scene.problem.robots = {"arm"};
  scene.truth.world_from_base = {Rigid3d()};
  const Mount base{0, Mount::Part::kBase};
  const Eigen::Vector3d middle(0.5, 0, 0.4);
  AddCamera("left", base, LookingAt({0.5, 0.6, 0.7}, middle, 0.3), setting, &scene);
  AddCamera("right", base, LookingAt({0.6, 0.55, 0.55}, middle, -0.2), setting, &scene);
  AddTarget("plate", {0, Mount::Part::kGripper}, Rigid3d(ExpRotation({0.4, 1, -0.3}), {0.02, 0.05, 0.08}), &scene);
  // In view of both cameras.
  const Rigid3d right_from_wall(ExpRotation({0.3, -0.2, 0.1}), {-0.07, -0.05, 0.6});
  AddTarget("wall", base, scene.truth.mount_from_camera[1] * right_from_wall, &scene);
  Simulate(setting, rng, &scene);
  for (ProblemCapture& capture : scene.problem.captures) {
    std::erase_if(capture.images, [](const ProblemImage& image) { return image.camera == 1 && image.target == 0; });
  }
  return scene;
}

// Without the intrinsics of the camera that the failure names, those of the others can be free.
TEST(CellAdjustment, NamesTheCameraWhoseIntrinsicsAreToBeHeld) {
  CellScene scene = CellWithStillCamera(6);
  const Outcome<Solution> free = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
  ASSERT_FALSE(free);
  EXPECT_NE(free.reason().find("unknown cameras.right."), std::string::npos) << free.reason();
  EXPECT_NE(free.reason().find("of_camera cameras.right.camera"), std::string::npos) << free.reason();
  scene.problem.cameras[1].free_intrinsics.clear();
  const Outcome<Solution> held = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
  ASSERT_TRUE(held) << held.reason();
  EXPECT_EQ(held->cameras[1].params, scene.problem.cameras[1].camera.params);
  EXPECT_TRUE(SigmaOf(held->covariance, "cameras.left.camera.fx").has_value());
}

// A prior holds them too, and the covariance of the camera's pose and parameters is then that of their errors.
TEST(CellAdjustment, CombinesThePriorOfACameraWithTheCaptures) {
  double chi2 = 0;
  int num_unknowns = 0;
  constexpr int kSeeds = 30;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    CellScene scene = CellWithStillCamera(static_cast<uint64_t>(seed));
    ProblemCamera& right = scene.problem.cameras[1];
    const std::vector<double> truth = right.camera.params;
    CameraPrior prior{truth, {3, 3, 2, 2, 5e-3, 1e-2, 2e-4, 2e-4, 1e-2}};
    ASSERT_EQ(prior.params.size(), prior.sigmas.size());
    Rng rng(static_cast<uint64_t>(seed), 5);
    for (size_t i = 0; i < prior.params.size(); ++i) prior.params[i] += prior.sigmas[i] * rng.Normal();
    right.camera.params = prior.params;
    right.prior = prior;
    const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
    ASSERT_TRUE(solution) << solution.reason();
    const UnknownLayout& layout = solution->covariance.layout;
    const UnknownBlock pose = layout.Block(CameraPoseBlock(right));
    const UnknownBlock camera = layout.Block(CameraBlock(right));
    std::vector<Eigen::Index> places;
    for (Eigen::Index i = pose.first; i < pose.end(); ++i) places.push_back(i);
    for (Eigen::Index i = camera.first; i < camera.end(); ++i) places.push_back(i);
    Eigen::VectorXd error(static_cast<Eigen::Index>(places.size()));
    error.head<6>() = LocalCoordinates(scene.truth.mount_from_camera[1], solution->poses.mount_from_camera[1]);
    for (size_t i = 0; i < truth.size(); ++i) {
      error[6 + static_cast<Eigen::Index>(i)] = solution->cameras[1].params[i] - truth[i];
    }
    const Eigen::MatrixXd covariance = solution->covariance.matrix(places, places);
    chi2 += MahalanobisSquare(error, covariance);
    num_unknowns += static_cast<int>(error.size());
    EXPECT_LT(*SigmaOf(solution->covariance, "cameras.right.camera.fx"), 3.0);
  }
  // Four standard deviations of the sum, and 3 % for noise that is estimated.
  EXPECT_NEAR(chi2, num_unknowns, 4 * std::sqrt(2.0 * num_unknowns) + 0.03 * num_unknowns);
}

TEST(CellAdjustment, NamesAnArmThatNothingJoins) {
  CellScene scene = TwoArmCell(5, {20, 0.1, {}});
  for (ProblemCapture& capture : scene.problem.captures) {
    std::erase_if(capture.images, [](const ProblemImage& image) { return image.target == 1; });
  }
  const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
  ASSERT_FALSE(solution);
  EXPECT_TRUE(solution.reason().find("right") != std::string::npos ||
              solution.reason().find("disk") != std::string::npos)
      << solution.reason();
}

}  // namespace
}  // namespace heba
