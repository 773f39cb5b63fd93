#include "heba/target_location.h"

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/bundle_adjustment.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

struct Case {
  const char* name;
  Setup setup;
  double robot_translation_m;
  double robot_rotation_rad;
};

class LocateTest : public testing::TestWithParam<Case> {};

// The camera is calibrated from all captures but the last, in which the target is then located: the error of its
// centre agrees with the stated covariance. The mean of 120 chi-squares with 3 degrees of freedom is within 4 sigmas
// (of 0.22) of 3.
TEST_P(LocateTest, ErrorsAgreeWithTheStatedCovariance) {
  const Case& test = GetParam();
  const bool is_noisy = test.robot_translation_m > 0;
  double sum = 0;
  double sum_on_plane = 0;
  double sum_on_target = 0;
  constexpr int kSeeds = 120;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    TestSceneOptions options;
    options.setup = test.setup;
    options.num_captures = 13;
    options.noise_px = 0.3;
    options.robot_translation_m = test.robot_translation_m;
    options.robot_rotation_rad = test.robot_rotation_rad;
    const TestScene scene = MakeTestScene(seed, options);
    std::vector<View> views = scene.views;
    const View unseen = views.back();
    views.pop_back();
    BundleOptions bundle;
    bundle.loss = LossKind::kNone;
    bundle.pixel_noise_px = 0.3;
    if (is_noisy) {
      bundle.robot = BundleOptions::Robot::kGivenNoise;
      bundle.robot_noise = {test.robot_translation_m, test.robot_rotation_rad};
    }
    const Outcome<PairSolution> solution = RefineHandEye({scene.camera, views, test.setup}, scene.hand_eye, bundle);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    // The robot gives the pose of the mount of a carried camera; the target is then fixed to the base.
    const bool is_carried = test.setup == Setup::kEyeInHand;
    const Rigid3d base_from_mount = is_carried ? Inverse(unseen.camera_mount_from_target_mount) : Rigid3d();
    const Outcome<LocatedTarget> located = LocateTarget(test.setup, *solution, unseen.observations, base_from_mount);
    ASSERT_TRUE(located.ok()) << located.reason();
    const Rigid3d truth = is_carried ? scene.hand_eye.target_mount_from_target
                                     : scene.hand_eye.camera_mount_from_camera * scene.pairs.back().camera_from_target;
    const Eigen::Vector3d middle = unseen.observations.points_in_target.rowwise().mean();
    const Eigen::Vector3d off_m = located->world_from_target * middle - truth * middle;
    const Eigen::Matrix3d covariance = located->covariance.TotalM2();
    sum += MahalanobisSquare(off_m, covariance);
    EXPECT_EQ(located->covariance.by_robot_m2.isZero(), !(is_carried && is_noisy));

    // A corner of the target is located from its pixel, on the plane of the target, which is either given or seen in
    // the image.
    const Eigen::Vector3d corner = unseen.observations.points_in_target.col(0);
    const Eigen::Vector2d pixel = unseen.observations.pixels.col(0);
    const Eigen::Vector3d normal = truth.rotation * Eigen::Vector3d::UnitZ();
    const Plane plane{normal, normal.dot(truth.translation)};
    const Outcome<LocatedPoint> on_plane = LocatePixel(test.setup, *solution, pixel, plane, base_from_mount);
    const Outcome<LocatedPoint> on_target =
        LocatePixelOnTarget(test.setup, *solution, pixel, unseen.observations, base_from_mount);
    ASSERT_TRUE(on_plane.ok()) << on_plane.reason();
    ASSERT_TRUE(on_target.ok()) << on_target.reason();
    const auto chi2 = [&](const LocatedPoint& point, const Eigen::MatrixXd& directions) {
      const Eigen::VectorXd off = directions.transpose() * (point.in_world - truth * corner);
      const Eigen::MatrixXd stated = directions.transpose() * point.covariance.TotalM2() * directions;
      return MahalanobisSquare(off, stated);
    };
    // A point on a known plane has errors in two directions only.
    EXPECT_LT(std::abs(normal.dot(on_plane->in_world) - plane.distance_m), 1e-9);
    sum_on_plane += chi2(*on_plane, truth.RotationMatrix().leftCols<2>());
    sum_on_target += chi2(*on_target, Eigen::Matrix3d::Identity());
  }
  EXPECT_NEAR(sum / kSeeds, 3, 0.9);
  EXPECT_NEAR(sum_on_plane / kSeeds, 2, 0.75);
  EXPECT_NEAR(sum_on_target / kSeeds, 3, 0.9);
}

INSTANTIATE_TEST_SUITE_P(, LocateTest,
                         testing::Values(Case{"EyeToHand", Setup::kEyeToHand, 0, 0},
                                         Case{"EyeInHand", Setup::kEyeInHand, 0, 0},
                                         Case{"EyeInHandNoisyRobot", Setup::kEyeInHand, 2e-4, 4e-4},
                                         Case{"EyeToHandNoisyRobot", Setup::kEyeToHand, 2e-4, 4e-4}),
                         [](const auto& test) { return test.param.name; });

TEST(LocatePixelTest, FailsIfTheRayMissesThePlane) {
  const TestScene scene = MakeTestScene(1);
  PairSolution solution;
  solution.hand_eye = scene.hand_eye;
  solution.camera = scene.camera;
  // One plane contains the optical axis of the camera, the other is behind the camera.
  const Rigid3d& camera = scene.hand_eye.camera_mount_from_camera;
  const Eigen::Vector3d side = camera.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d ahead = camera.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector2d middle(scene.camera.params[2], scene.camera.params[3]);
  const Plane along{side, side.dot(camera.translation)};
  const Plane behind{ahead, ahead.dot(camera.translation) - 1};
  EXPECT_NE(LocatePixel(Setup::kEyeToHand, solution, middle, along, Rigid3d()).reason(), "");
  EXPECT_NE(LocatePixel(Setup::kEyeToHand, solution, middle, behind, Rigid3d()).reason(), "");
}

// The variance along the normal of a plane is zero, which rounding must not make negative.
TEST(LocatePixelTest, HasNoNegativeVarianceAlongTheNormal) {
  const TestScene scene = MakeTestScene(1);
  PairSolution solution;
  solution.hand_eye = scene.hand_eye;
  solution.camera = scene.camera;
  solution.pixel_sigma_px = 0.1;
  solution.covariance.layout.AddPose(kHandEyeBlock);
  solution.covariance.matrix = 1e-6 * Eigen::MatrixXd::Identity(6, 6);
  const Rigid3d& camera = scene.hand_eye.camera_mount_from_camera;
  const Eigen::Vector3d ahead = camera.rotation * Eigen::Vector3d::UnitZ();
  Eigen::Index axis = 0;
  ahead.cwiseAbs().maxCoeff(&axis);
  const Eigen::Vector3d normal = Eigen::Vector3d::Unit(axis);
  const Plane plane{normal, normal.dot(camera.translation + 0.8 * ahead)};
  for (int u = 0; u < 10; ++u) {
    for (int v = 0; v < 10; ++v) {
      const Eigen::Vector2d pixel(scene.camera.params[2] + 10 * u, scene.camera.params[3] + 10 * v);
      const Outcome<LocatedPoint> located = LocatePixel(Setup::kEyeToHand, solution, pixel, plane, Rigid3d());
      ASSERT_TRUE(located.ok()) << located.reason();
      const PositionCovariance& covariance = located->covariance;
      for (const Eigen::Matrix3d& part : {covariance.by_calibration_m2, covariance.by_image_m2}) {
        EXPECT_GE(part.diagonal().minCoeff(), 0);
        // Rounding leaves less than a nanometre.
        EXPECT_LT(part(axis, axis), 1e-18);
      }
    }
  }
}

// A target of 8 x 6 points that is printed 1 % too wide and 2 % too high looks the same after a rotation by 180 deg.
TEST(LocateSymmetricTargetTest, ReturnsAllPosesForEitherReadingOfTheTarget) {
  TestSceneOptions options;
  options.points.colwise() += Eigen::Vector3d(0.2, 0.1, 0);
  options.shape = {1.01, 1.02, 0, 0};
  const TestScene scene = MakeTestScene(3, options);
  PairSolution solution;
  solution.hand_eye = scene.hand_eye;
  solution.camera = scene.camera;
  solution.shape = DesignedShape(options.points);
  solution.shape.params = options.shape;
  solution.pixel_sigma_px = 0.1;
  solution.covariance.layout.AddPose(kHandEyeBlock);
  solution.covariance.matrix = Eigen::MatrixXd::Identity(6, 6);
  const std::vector<Rigid3d> symmetries = {
      Rigid3d(), Rigid3d(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d(2 * 0.2, 2 * 0.1, 0))};
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const Observations& observations = scene.views[i].observations;
    Observations turned = observations;
    for (Eigen::Index k = 0; k < turned.size(); ++k) {
      const Eigen::Vector3d point = observations.points_in_target.col(k);
      turned.points_in_target.col(k) = symmetries[1] * point;
    }
    const auto locate = [&](const Observations& reading) {
      return LocateSymmetricTarget(Setup::kEyeToHand, solution, reading, symmetries, Rigid3d());
    };
    const Outcome<std::vector<LocatedTarget>> possible = locate(observations);
    const Outcome<std::vector<LocatedTarget>> again = locate(turned);
    ASSERT_TRUE(possible.ok()) << possible.reason();
    ASSERT_TRUE(again.ok()) << again.reason();
    ASSERT_EQ(possible->size(), 2U);
    const Rigid3d truth = scene.hand_eye.camera_mount_from_camera * scene.pairs[i].camera_from_target;
    // The pixels are exact: the tolerance is that of the convergence of the iteration.
    constexpr double kToleranceM = 1e-6;
    const size_t right = AngleRad((*possible)[0].world_from_target, truth) < 1 ? 0 : 1;
    EXPECT_LT(DistanceM((*possible)[right].world_from_target, truth), kToleranceM);
    for (Eigen::Index k = 0; k < observations.size(); ++k) {
      const Eigen::Vector3d point = observations.points_in_target.col(k);
      const Eigen::Vector3d other = turned.points_in_target.col(k);
      const Eigen::Vector3d in_base = (*possible)[1 - right].world_from_target * ApplyShape(other, solution.shape);
      EXPECT_LT((in_base - truth * ApplyShape(point, solution.shape)).norm(), kToleranceM);
    }
    for (size_t n = 0; n < 2; ++n) {
      EXPECT_LT(DistanceM((*possible)[n].world_from_target, (*again)[n].world_from_target), kToleranceM);
      EXPECT_LT(AngleRad((*possible)[n].world_from_target, (*again)[n].world_from_target), kToleranceM);
    }
  }
}

TEST(FindMeantPoseTest, ReturnsNothingForAnAmbiguousRotation) {
  std::vector<Rigid3d> possible(2);
  possible[1] = Rigid3d(ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero());
  const auto meant = [&](double angle_deg) {
    return FindMeantPose(possible, Rigid3d(ExpRotation({0, 0, DegToRad(angle_deg)}), Eigen::Vector3d(1, 2, 3)));
  };
  EXPECT_EQ(meant(0), 0U);
  EXPECT_EQ(meant(74), 0U);
  EXPECT_EQ(meant(76), std::nullopt);
  EXPECT_EQ(meant(104), std::nullopt);
  EXPECT_EQ(meant(106), 1U);
  // Rotations farther than 75 deg from both poses do not decide.
  EXPECT_EQ(FindMeantPose(possible, Rigid3d(ExpRotation({kPi / 2, 0, 0}), Eigen::Vector3d(1, 2, 3))), std::nullopt);
  EXPECT_EQ(FindMeantPose({}, Rigid3d()), std::nullopt);
  possible.pop_back();
  EXPECT_EQ(meant(170), 0U);
}

// The position decides if it is near, even with a rotation that is not known.
TEST(FindMeantPoseTest, DecidesByPositionOrByRotation) {
  std::vector<Rigid3d> possible(2);
  possible[1] = Rigid3d(ExpRotation({0, 0, kPi}), Eigen::Vector3d(0.1, 0, 0));
  const auto meant = [&](double angle_deg, double x_m) {
    return FindMeantPose(possible, Rigid3d(ExpRotation({0, 0, DegToRad(angle_deg)}), Eigen::Vector3d(x_m, 0, 0)));
  };
  EXPECT_EQ(meant(90, 0.024), 0U);
  EXPECT_EQ(meant(90, 0.026), std::nullopt);
  EXPECT_EQ(meant(90, 0.1), 1U);
  EXPECT_EQ(meant(20, 5), 0U);
  // The rotation of the other pose is 40 deg off, and then 20 deg.
  EXPECT_EQ(meant(40, 0.1), 1U);
  EXPECT_EQ(meant(20, 0.1), std::nullopt);
}

TEST(LocateFewPointsTest, FailsForTooFewPoints) {
  const TestScene scene = MakeTestScene(1);
  PairSolution solution;
  solution.hand_eye = scene.hand_eye;
  solution.camera = scene.camera;
  Observations few = scene.views[0].observations;
  few.ids.resize(3);
  few.points_in_target.conservativeResize(3, 3);
  few.pixels.conservativeResize(2, 3);
  EXPECT_NE(LocateTarget(Setup::kEyeToHand, solution, few, Rigid3d()).reason(), "");
}

}  // namespace
}  // namespace heba
