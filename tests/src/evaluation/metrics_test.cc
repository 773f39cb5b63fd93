// Tests of the metrics of a report against examples that were worked out by hand.
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"

namespace heba {
namespace {

// px, mm and deg: rounding of sums of a few products in double precision.
constexpr double kRoundOff = 1e-9;

Camera SimpleCamera() { return {"pinhole", 640, 480, {100, 200, 320, 240}}; }

// Returns observations of two points that lie at (0, 0, 2) and (1, 1, 2) m in the camera frame under kTwoMetresAhead
// and project to (320, 240) and (370, 340) px.
Observations TwoPoints(const Eigen::Vector2d& first_offset_px, const Eigen::Vector2d& second_offset_px) {
  Observations observations;
  observations.ids = {0, 1};
  observations.points_in_target.resize(3, 2);
  observations.points_in_target << 0, 1, 0, 1, 0, 0;
  observations.pixels.resize(2, 2);
  observations.pixels.col(0) = Eigen::Vector2d(320, 240) + first_offset_px;
  observations.pixels.col(1) = Eigen::Vector2d(370, 340) + second_offset_px;
  return observations;
}

const Rigid3d kTwoMetresAhead(Eigen::Quaterniond::Identity(), {0, 0, 2});

TEST(Residuals, ArePredictedMinusObserved) {
  const std::optional<Points2> residuals = Residuals(SimpleCamera(), kTwoMetresAhead, TwoPoints({3, 4}, {0, -1}));
  ASSERT_TRUE(residuals.has_value());
  Points2 expected(2, 2);
  expected << -3, 0, -4, 1;
  EXPECT_LT((*residuals - expected).norm(), kRoundOff);
}

TEST(ViewErrorsTest, SumSquaredDistances) {
  const std::optional<SquaredErrors> errors = ViewErrors(SimpleCamera(), kTwoMetresAhead, TwoPoints({3, 4}, {0, 1}));
  ASSERT_TRUE(errors.has_value());
  EXPECT_NEAR(errors->sum_px2, 26, kRoundOff);
  EXPECT_EQ(errors->num_points, 2);
  // The RMS is over points, not over coordinates: sqrt(26 / 2).
  EXPECT_NEAR(*errors->RmsPx(), std::sqrt(13.0), kRoundOff);
}

TEST(ViewErrorsTest, ReturnsNothingIfAPointHasNoImage) {
  const Rigid3d behind(Eigen::Quaterniond::Identity(), {0, 0, -2});
  EXPECT_FALSE(ViewErrors(SimpleCamera(), behind, TwoPoints({0, 0}, {0, 0})).has_value());
  // One of the two points is behind the camera.
  const Rigid3d across(ExpRotation({0, kPi / 2, 0}), {0, 0, 0.5});
  EXPECT_FALSE(ViewErrors(SimpleCamera(), across, TwoPoints({0, 0}, {0, 0})).has_value());
}

TEST(SquaredErrorsTest, ReturnNothingWithoutPoints) { EXPECT_FALSE(SquaredErrors().RmsPx().has_value()); }

TEST(ReprojectionErrorsTest, FollowTheRobotAndPoolPoints) {
  // The chain is camera_from_target = Inverse(camera_mount_from_camera) * camera_mount_from_target_mount *
  // target_mount_from_target.
  HandEye hand_eye;
  hand_eye.camera_mount_from_camera = Rigid3d(ExpRotation({0, 0, 0.3}), {0.1, 0.2, 0.3});
  hand_eye.target_mount_from_target = Rigid3d(ExpRotation({0.2, 0, 0}), {-0.1, 0, 0.05});
  const Rigid3d camera_mount_from_target_mount =
      hand_eye.camera_mount_from_camera * kTwoMetresAhead * Inverse(hand_eye.target_mount_from_target);
  std::vector<View> views(2);
  views[0] = {"a", camera_mount_from_target_mount, TwoPoints({3, 4}, {0, 0})};
  views[1] = {"b", camera_mount_from_target_mount, TwoPoints({0, 0}, {1, 0})};
  const std::optional<SquaredErrors> errors = ReprojectionErrors(hand_eye, SimpleCamera(), views);
  ASSERT_TRUE(errors.has_value());
  EXPECT_EQ(errors->num_points, 4);
  EXPECT_NEAR(*errors->RmsPx(), std::sqrt(26.0 / 4), kRoundOff);

  views[1].camera_mount_from_target_mount.translation.z() -= 10;
  EXPECT_FALSE(ReprojectionErrors(hand_eye, SimpleCamera(), views).has_value());
}

// Returns pose pairs that fit X = camera_mount_from_camera and Z = target_mount_from_target exactly.
std::vector<PosePair> ExactPairs(const HandEye& hand_eye, int count) {
  Rng rng(1);
  std::vector<PosePair> pairs;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d rotation_vector = rng.NormalVector3();
    const Rigid3d camera_mount_from_target_mount(ExpRotation(rotation_vector), rng.NormalVector3());
    pairs.push_back({camera_mount_from_target_mount, CameraFromTarget(hand_eye, camera_mount_from_target_mount)});
  }
  return pairs;
}

TEST(AxxbMeanMmTest, IsZeroForTheTruth) {
  HandEye hand_eye;
  hand_eye.camera_mount_from_camera = Rigid3d(ExpRotation({0.1, -0.4, 0.3}), {0.1, 0.2, 0.3});
  hand_eye.target_mount_from_target = Rigid3d(ExpRotation({0.2, 1, 0}), {-0.1, 0, 0.05});
  EXPECT_NEAR(*AxxbMeanMm(ExactPairs(hand_eye, 5), hand_eye.camera_mount_from_camera), 0, kRoundOff);
}

TEST(AxxbMeanMmTest, IsTheMeanOverConsecutivePairsInMm) {
  // The robot stands still while the target moves by 3 mm and then by 4 mm in the camera frame. |A X - X B| is then
  // the norm of these translations, and its mean is 3.5 mm. The pair (1, 3) is not consecutive and does not count.
  std::vector<PosePair> pairs(3);
  pairs[1].camera_from_target.translation.x() = 0.003;
  pairs[2].camera_from_target.translation.x() = 0.007;
  EXPECT_NEAR(*AxxbMeanMm(pairs, Rigid3d()), 3.5, kRoundOff);
}

TEST(AxxbMeanMmTest, CountsRotationsToo) {
  // B is a rotation by the angle t about z, and A = X = 1: |1 - R| = sqrt(2 (1 - cos t)) sqrt(2) = 2 sqrt(2) sin(t /
  // 2).
  std::vector<PosePair> pairs(2);
  pairs[1].camera_from_target.rotation = ExpRotation({0, 0, 0.2});
  EXPECT_NEAR(*AxxbMeanMm(pairs, Rigid3d()), 2 * std::sqrt(2.0) * std::sin(0.1), kRoundOff);
}

TEST(AxxbMeanMmTest, NeedsTwoCaptures) {
  EXPECT_FALSE(AxxbMeanMm({}, Rigid3d()).has_value());
  EXPECT_FALSE(AxxbMeanMm(std::vector<PosePair>(1), Rigid3d()).has_value());
}

TEST(BoardScatterTest, IsZeroForTheTruth) {
  HandEye hand_eye;
  hand_eye.camera_mount_from_camera = Rigid3d(ExpRotation({0.1, -0.4, 0.3}), {0.1, 0.2, 0.3});
  hand_eye.target_mount_from_target = Rigid3d(ExpRotation({0.2, 1, 0}), {-0.1, 0, 0.05});
  const std::optional<BoardScatter> scatter = ComputeBoardScatter(ExactPairs(hand_eye, 5), hand_eye);
  ASSERT_TRUE(scatter.has_value());
  EXPECT_NEAR(scatter->translation_rms_mm, 0, kRoundOff);
  // deg; the angles are computed from matrices that are accurate to 1e-16.
  EXPECT_NEAR(scatter->rotation_rms_deg, 0, 1e-7);
}

TEST(BoardScatterTest, IsTheRootMeanSquareAboutTheMean) {
  // The two target poses are at +-3 mm and rotated by +-2 deg about the same axis.
  std::vector<PosePair> pairs(2);
  pairs[0].camera_from_target = Rigid3d(ExpRotation({0, 0, DegToRad(2)}), {0.103, 0, 0});
  pairs[1].camera_from_target = Rigid3d(ExpRotation({0, 0, DegToRad(-2)}), {0.097, 0, 0});
  const std::optional<BoardScatter> scatter = ComputeBoardScatter(pairs, HandEye());
  ASSERT_TRUE(scatter.has_value());
  EXPECT_NEAR(scatter->translation_rms_mm, 3, kRoundOff);
  EXPECT_NEAR(scatter->rotation_rms_deg, 2, kRoundOff);
  EXPECT_FALSE(ComputeBoardScatter({}, HandEye()).has_value());
}

TEST(CompareWithTruthTest, GivesDistancesAndAngles) {
  HandEye hand_eye;
  hand_eye.camera_mount_from_camera = Rigid3d(ExpRotation({0, DegToRad(1), 0}), {0.003, 0.004, 0});
  hand_eye.target_mount_from_target = Rigid3d(ExpRotation({0, 0, DegToRad(0.5)}), {0, 0, 0.002});
  Camera camera = SimpleCamera();
  Truth truth;
  truth.target_mount_from_target = Rigid3d();
  truth.camera = camera;
  camera.params[0] += 3;
  camera.params[1] -= 1;
  const TruthErrors errors = CompareWithTruth(hand_eye, camera, truth, {Rigid3d()});
  EXPECT_NEAR(errors.hand_eye_mm, 5, kRoundOff);
  EXPECT_NEAR(errors.hand_eye_deg, 1, kRoundOff);
  EXPECT_NEAR(*errors.board_mm, 2, kRoundOff);
  EXPECT_NEAR(*errors.board_deg, 0.5, kRoundOff);
  EXPECT_NEAR(*errors.focal_px, std::sqrt(5.0), kRoundOff);  // sqrt((9 + 1) / 2)
}

TEST(CompareWithTruthTest, ComparesOnlyWhatTheTruthContains) {
  const TruthErrors errors = CompareWithTruth(HandEye(), SimpleCamera(), Truth(), {Rigid3d()});
  EXPECT_EQ(errors.hand_eye_mm, 0);
  EXPECT_FALSE(errors.board_mm.has_value());
  EXPECT_FALSE(errors.board_deg.has_value());
  EXPECT_FALSE(errors.focal_px.has_value());
}

TEST(CompareWithTruthTest, ComparesASymmetricTargetWithItsNearestReading) {
  // The target was detected upside down, which rotates its frame by 180 deg about the centre at (0.1, 0.05, 0) m.
  const Rigid3d half_turn(ExpRotation({0, 0, kPi}), {0.2, 0.1, 0});
  Truth truth;
  truth.target_mount_from_target = Rigid3d(ExpRotation({0.3, 0, 0}), {0, 0, 1});
  HandEye hand_eye;
  hand_eye.target_mount_from_target =
      *truth.target_mount_from_target * half_turn * Rigid3d(ExpRotation({0, 0, DegToRad(1)}), {0, 0, 0});
  const TruthErrors one = CompareWithTruth(hand_eye, SimpleCamera(), truth, {Rigid3d()});
  EXPECT_NEAR(*one.board_deg, 179, kRoundOff);
  const TruthErrors both = CompareWithTruth(hand_eye, SimpleCamera(), truth, {Rigid3d(), half_turn});
  EXPECT_NEAR(*both.board_deg, 1, kRoundOff);
  // The residual is the distance of the centre from the origin times the chord of 1 deg.
  EXPECT_NEAR(*both.board_mm, 1000 * 2 * std::sin(DegToRad(0.5)) * std::hypot(0.2, 0.1), kRoundOff);
}

}  // namespace
}  // namespace heba
