#include "solvers/calibration/point_estimation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/rng.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/hand_eye.h"
#include "heba/pair_calibration.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// A scene whose points lie beside their design, which the views hold.
struct DisplacedScene {
  TestScene scene;
  TestSceneOptions options;
  Points3 offsets_m;  // One per point, without a motion of the target.
};

Points3 WithoutMotion(const Points3& offsets_m, const Points3& points) {
  const Eigen::Vector3d middle = points.rowwise().mean();
  Eigen::MatrixXd motions(3 * points.cols(), 6);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    motions.block<3, 3>(3 * i, 0).setIdentity();
    motions.block<3, 3>(3 * i, 3) = -Skew(points.col(i) - middle);
  }
  Eigen::VectorXd joined(motions.rows());
  for (Eigen::Index i = 0; i < points.cols(); ++i) joined.segment<3>(3 * i) = offsets_m.col(i);
  const Eigen::MatrixXd basis = HouseholderFactor(motions).Basis();
  joined -= basis * (basis.transpose() * joined);
  Points3 rest(3, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) rest.col(i) = joined.segment<3>(3 * i);
  return rest;
}

DisplacedScene MakeDisplaced(uint64_t seed, double sigma_m, const Points3& points = TestSceneOptions().points) {
  DisplacedScene made;
  made.options.points = points;
  made.options.noise_px = 0.1;
  made.options.num_captures = 20;
  made.options.robot_translation_m = 1e-4;
  made.options.robot_rotation_rad = 2e-4;
  Rng rng(seed);
  Points3 offsets_m(3, points.cols());
  for (double& offset_m : offsets_m.reshaped()) offset_m = sigma_m * rng.Normal();
  made.offsets_m = WithoutMotion(offsets_m, points);
  TestSceneOptions printed = made.options;
  printed.points += made.offsets_m;
  made.scene = MakeTestScene(seed, printed);
  for (View& view : made.scene.views) {
    for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
      view.observations.points_in_target.col(i) = points.col(view.observations.ids[static_cast<size_t>(i)]);
    }
  }
  return made;
}

// The estimate with the points where two rounds have found them.
struct Estimated {
  PairSolution solution;
  EstimatedPoints points;
};

Estimated Estimate(const DisplacedScene& made) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  Estimated estimated;
  estimated.points.offsets.resize(1);
  constexpr int kNumRounds = 3;
  for (int round = 0; round < kNumRounds; ++round) {
    PairProblem problem{made.scene.camera, made.scene.views, made.options.setup, DesignedShape(made.options.points)};
    for (View& view : problem.views) {
      for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
        const auto offset = estimated.points.offsets[0].find(view.observations.ids[static_cast<size_t>(i)]);
        if (offset != estimated.points.offsets[0].end()) view.observations.points_in_target.col(i) += offset->second;
      }
    }
    const Outcome<PairSolution> solution = RefineHandEye(problem, made.scene.hand_eye, options);
    EXPECT_TRUE(solution.ok()) << solution.reason();
    estimated.solution = *solution;
    const auto points =
        EstimatePoints(HandEyeProblem(problem, options), ProblemSolution(*solution), {0}, estimated.points.offsets);
    EXPECT_TRUE(points.has_value());
    estimated.points = *points;
  }
  return estimated;
}

// Returns the square of the error of the camera's pose in units of a covariance, per coordinate.
double SquareOfError(const DisplacedScene& made, const PairSolution& solution, const Covariance& covariance) {
  const Tangent6 error =
      LocalCoordinates(made.scene.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
  return MahalanobisSquare(error, Eigen::MatrixXd(covariance.matrix.topLeftCorner<6, 6>())) / 6;
}

TEST(PointEstimationTest, FindsThePointsAndTheirSigma) {
  constexpr double kSigmaM = 2e-4;
  const DisplacedScene made = MakeDisplaced(3, kSigmaM);
  const Estimated estimated = Estimate(made);
  EXPECT_NEAR(estimated.points.sigma_m, kSigmaM, 0.25 * kSigmaM);
  EXPECT_LT(estimated.points.p_value, 1e-12);
  ASSERT_EQ(estimated.points.offsets[0].size(), static_cast<size_t>(made.offsets_m.cols()));
  double squares = 0;
  for (const auto& [id, offset_m] : estimated.points.offsets[0]) {
    squares += (offset_m - made.offsets_m.col(id)).squaredNorm();
  }
  // A coordinate of a point in 20 images of 0.1 px is known to some 0.02 mm, and less along the line of sight.
  EXPECT_LT(std::sqrt(squares / static_cast<double>(made.offsets_m.size())), 0.4 * kSigmaM);
}

TEST(PointEstimationTest, FindsNoneWhereTheDesignHolds) {
  int num_found = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    const Estimated estimated = Estimate(MakeDisplaced(seed, 0));
    num_found += estimated.points.p_value < 0.01 ? 1 : 0;
    EXPECT_LT(estimated.points.sigma_m, 3e-5) << seed;
  }
  EXPECT_LE(num_found, 1);
}

// The errors of the camera's pose are as large as the covariance with the changes says.
TEST(PointEstimationTest, UncertaintyOfThePointsIsPartOfThatOfTheCamera) {
  double sum = 0;
  constexpr int kNumSeeds = 16;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const DisplacedScene made = MakeDisplaced(seed, 3e-4);
    const Estimated estimated = Estimate(made);
    Covariance covariance = estimated.solution.covariance;
    covariance = WithChanges(std::move(covariance), estimated.points.changes);
    sum += SquareOfError(made, estimated.solution, covariance) / kNumSeeds;
  }
  // The mean of 96 squares of normal numbers is within these limits in 99 of 100 sets.
  EXPECT_GT(sum, 0.66);
  EXPECT_LT(sum, 1.42);
}

// A target of many points has fewer unknowns, of which neighbours share some.
TEST(PointEstimationTest, SmoothOffsetsOfManyPointsAreFound) {
  const Points3 points = GridPoints(14, 12, 0.015);
  ASSERT_GT(static_cast<size_t>(points.cols()), kMostFreePoints);
  DisplacedScene made = MakeDisplaced(5, 0, points);
  Points3 fold_m = Points3::Zero(3, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) fold_m(2, i) = 5e-4 * std::exp(-std::pow(points(0, i) / 0.03, 2));
  made.offsets_m = WithoutMotion(fold_m, points);
  TestSceneOptions printed = made.options;
  printed.points += made.offsets_m;
  made.scene = MakeTestScene(5, printed);
  for (View& view : made.scene.views) {
    for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
      view.observations.points_in_target.col(i) = points.col(view.observations.ids[static_cast<size_t>(i)]);
    }
  }
  const Estimated estimated = Estimate(made);
  double squares = 0;
  for (const auto& [id, offset_m] : estimated.points.offsets[0]) {
    squares += (offset_m - made.offsets_m.col(id)).squaredNorm();
  }
  EXPECT_LT(std::sqrt(squares / made.offsets_m.squaredNorm()), 0.25);
}

TEST(PointEstimationTest, TargetsThatAreNotNamedStayAsDesigned) {
  const DisplacedScene made = MakeDisplaced(3, 2e-4);
  BundleOptions options;
  options.free_intrinsics = {};
  const PairProblem problem{made.scene.camera, made.scene.views, made.options.setup,
                            DesignedShape(made.options.points)};
  const Outcome<PairSolution> solution = RefineHandEye(problem, made.scene.hand_eye, options);
  ASSERT_TRUE(solution) << solution.reason();
  const auto points = EstimatePoints(HandEyeProblem(problem, options), ProblemSolution(*solution), {}, {{}});
  ASSERT_TRUE(points.has_value());
  EXPECT_TRUE(points->offsets[0].empty());
  EXPECT_TRUE(points->changes.empty());
}

}  // namespace
}  // namespace heba
