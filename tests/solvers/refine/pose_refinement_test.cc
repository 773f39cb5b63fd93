#include "solvers/refine/pose_refinement.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/initial/pose_selection.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

class ChainTest : public testing::TestWithParam<Setup> {};

TEST_P(ChainTest, RecoversExactDataFromARoughInitialGuess) {
  const TestScene scene = MakeTestScene(4, {.setup = GetParam()});
  HandEye start = scene.hand_eye;
  start.camera_mount_from_camera = Retract(start.camera_mount_from_camera, 0.2 * Tangent6(1, -1, 0.5, 1, 1, -1));
  const Outcome<PairSolution> solution = RefineChain(scene.pairs, start);
  ASSERT_TRUE(solution.ok()) << solution.reason();
  constexpr double kRoundOff = 1e-8;  // rad and m
  EXPECT_THAT(solution->hand_eye.camera_mount_from_camera,
              IsNearPose(scene.hand_eye.camera_mount_from_camera, kRoundOff, kRoundOff));
  EXPECT_THAT(solution->hand_eye.target_mount_from_target,
              IsNearPose(scene.hand_eye.target_mount_from_target, kRoundOff, kRoundOff));
}

// Each pose is weighted by its covariance from the image. The refinement of the chain is then far more accurate than
// the closed form, and its covariance is right: the chi-square has 12 degrees of freedom per seed, and the tolerance
// is four sigma of the sum plus 3 % for the estimated scale.
TEST_P(ChainTest, WeightsPosesByTheirCovariance) {
  constexpr int kSeeds = 60;
  double chi2 = 0;
  double chain_m2 = 0;
  double shah_m2 = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    TestSceneOptions options;
    options.setup = GetParam();
    options.noise_px = 0.2;
    options.num_captures = 20;
    const TestScene scene = MakeTestScene(static_cast<uint64_t>(seed), options);
    const std::vector<PosePair> pairs = PosePairsOf(scene.camera, scene.hand_eye, scene.views);
    const Outcome<HandEye> shah = FindHandEyeMethod("shah")->solve(pairs);
    const Outcome<PairSolution> solution = RefineChain(pairs, *shah);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    Eigen::Matrix<double, 12, 1> error;
    error << LocalCoordinates(scene.hand_eye.camera_mount_from_camera, solution->hand_eye.camera_mount_from_camera),
        LocalCoordinates(scene.hand_eye.target_mount_from_target, solution->hand_eye.target_mount_from_target);
    chi2 += MahalanobisSquare(error, solution->covariance.matrix);
    chain_m2 += error.head<3>().squaredNorm();
    shah_m2 += std::pow(DistanceM(scene.hand_eye.camera_mount_from_camera, shah->camera_mount_from_camera), 2);
  }
  const double dof = 12.0 * kSeeds;
  EXPECT_NEAR(chi2, dof, 4 * std::sqrt(2 * dof) + 0.03 * dof);
  EXPECT_LT(std::sqrt(chain_m2), 0.5 * std::sqrt(shah_m2));
}

INSTANTIATE_TEST_SUITE_P(Setups, ChainTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

}  // namespace
}  // namespace heba
