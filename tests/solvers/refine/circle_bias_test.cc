// Test of the bias of circle centres: the dots are large, tilted and seen through a strongly distorting lens, so the
// image of a dot's centre and the centroid of its image differ by tenths of a pixel. This must not bias the estimate.
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/rng.h"
#include "heba/bundle_adjustment.h"
#include "heba/evaluation/metrics.h"
#include "tests/support/imaged_disc.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kNoisePx = 0.01;
constexpr double kDistanceM = 0.3;
constexpr double kRadiusM = 20 * kDistanceM / 600;  // 20 px at f = 600 px.

Camera WideCamera() { return {"brown5", 1280, 960, {600, 600, 640, 480, -0.2, 0.05, 0, 0, 0}}; }

// Returns a scene of discs whose observations are the centroids of their images, as detectors measure them, with
// noise.
TestScene DiscScene(uint64_t seed, Setup setup) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 15;
  options.camera = WideCamera();
  options.points = GridPoints(4, 3, 0.04);
  options.max_tilt_rad = DegToRad(40);
  options.distance_m = kDistanceM;
  TestScene scene = MakeTestScene(seed, options);
  Rng rng(seed, 1);
  for (size_t v = 0; v < scene.views.size(); ++v) {
    Observations& observations = scene.views[v].observations;
    observations.radii_m = Eigen::VectorXd::Constant(observations.size(), kRadiusM);
    for (Eigen::Index i = 0; i < observations.size(); ++i) {
      observations.pixels.col(i) = ImagedCentroid(scene.camera, scene.pairs[v].camera_from_target,
                                                  observations.points_in_target.col(i), kRadiusM) +
                                   kNoisePx * Eigen::Vector2d{rng.Normal(), rng.Normal()};
    }
  }
  return scene;
}

// Returns the views without the radii of the discs: the centroids are taken for the images of the centres.
std::vector<View> WithoutRadii(std::vector<View> views) {
  for (View& view : views) view.observations.radii_m.resize(0);
  return views;
}

// Returns the error of the hand-eye pose, m and rad.
Tangent6 HandEyeError(const TestScene& scene, const PairSolution& solution) {
  return LocalCoordinates(scene.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
}

// Returns the squared error of the hand-eye pose, whitened by its covariance.
double WhitenedSquare(const TestScene& scene, const PairSolution& solution) {
  const Tangent6 error = HandEyeError(scene, solution);
  return MahalanobisSquare(error, solution.covariance.matrix.topLeftCorner<6, 6>());
}

class CircleBiasTest : public testing::TestWithParam<Setup> {};

TEST_P(CircleBiasTest, EstimateAgreesWithItsCovariance) {
  constexpr int kSeeds = 100;
  double chi2 = 0;
  double chi2_of_plain_centres = 0;
  double squares_m2 = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const TestScene scene = DiscScene(static_cast<uint64_t>(seed), GetParam());
    BundleOptions options;
    options.loss = LossKind::kNone;
    options.pixel_noise_px = kNoisePx;
    const Outcome<PairSolution> with_discs =
        RefineHandEye({scene.camera, scene.views, GetParam()}, scene.hand_eye, options);
    ASSERT_TRUE(with_discs.ok()) << with_discs.reason();
    chi2 += WhitenedSquare(scene, *with_discs);
    squares_m2 += HandEyeError(scene, *with_discs).head<3>().squaredNorm();
    const Outcome<PairSolution> with_plain_centres =
        RefineHandEye({scene.camera, WithoutRadii(scene.views), GetParam()}, scene.hand_eye, options);
    ASSERT_TRUE(with_plain_centres.ok()) << with_plain_centres.reason();
    chi2_of_plain_centres += WhitenedSquare(scene, *with_plain_centres);
  }
  RecordProperty("chi2_per_dof", std::to_string(chi2 / (6 * kSeeds)));
  RecordProperty("chi2_per_dof_of_plain_centres", std::to_string(chi2_of_plain_centres / (6 * kSeeds)));
  RecordProperty("rms_mm", std::to_string(1000 * std::sqrt(squares_m2 / kSeeds)));
  // The chi-square has six degrees of freedom per seed; the tolerance is four sigma of the sum.
  const double dof = 6.0 * kSeeds;
  EXPECT_NEAR(chi2, dof, 4 * std::sqrt(2 * dof));
  // The same observations are far outside if the centroids are taken for the images of the centres.
  EXPECT_GT(chi2_of_plain_centres, 10 * dof);
}

INSTANTIATE_TEST_SUITE_P(Setups, CircleBiasTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

}  // namespace
}  // namespace heba
