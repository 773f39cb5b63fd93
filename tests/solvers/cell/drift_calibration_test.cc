#include "solvers/cell/drift_calibration.h"

#include <cmath>
#include <optional>
#include <utility>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/calibration.h"
#include "heba/evaluation/metrics.h"
#include "tests/support/cell_scenes.h"

namespace heba {
namespace {

constexpr DriftBody kSecondCamera = {DriftBody::Kind::kCamera, 1};

CalibrationOptions GivenCameras(const CellScene& scene) {
  CalibrationOptions options;
  options.choose_target_shape = false;
  options.smooth = SmoothPoseErrors::kNone;
  options.has_camera.assign(scene.problem.cameras.size(), true);
  return options;
}

// Takes all images again with a body that moves; the truth of the scene is its pose at the end.
void AddDrift(const Drift& drift, CellScene* scene) {
  Rng rng(17);
  const size_t num_captures = scene->problem.captures.size();
  for (size_t i = 0; i < num_captures; ++i) {
    CellPoses then = scene->truth;
    Rigid3d& body = drift.body.kind == DriftBody::Kind::kCamera   ? then.mount_from_camera[drift.body.index]
                    : drift.body.kind == DriftBody::Kind::kTarget ? then.mount_from_target[drift.body.index]
                                                                  : then.world_from_base[drift.body.index];
    body = Retract(body, -RemainingShare(drift, i, num_captures) * drift.change);
    for (ProblemImage& image : scene->problem.captures[i].images) {
      const std::optional<View> view =
          SimulateView("", scene->problem.cameras[image.camera].camera, {},
                       CameraFromTarget(scene->problem, then, image.camera, image.target, scene->arms[i]),
                       scene->targets[image.target].points_in_target, CellSceneSetting().noise_px, rng);
      ASSERT_TRUE(view);
      image.observations = view->observations;
    }
  }
}

Drift DriftOf(const DriftBody& body, double translation_m, double rotation_deg) {
  Drift drift;
  drift.body = body;
  drift.change << translation_m, -0.5 * translation_m, 0, 0, DegToRad(rotation_deg), 0;
  return drift;
}

int NumUsed(const Calibration& calibration, size_t camera) {
  int num_used = 0;
  for (const ProblemCapture& capture : calibration.problem.captures) {
    for (const ProblemImage& image : capture.images) {
      num_used += image.camera == camera && image.observations.size() > 0 ? 1 : 0;
    }
  }
  return num_used;
}

int NumSeen(const CellScene& scene, size_t camera) {
  int num_seen = 0;
  for (const ProblemCapture& capture : scene.problem.captures) {
    for (const ProblemImage& image : capture.images) num_seen += image.camera == camera ? 1 : 0;
  }
  return num_seen;
}

void ExpectDrift(const Drift& found, const Drift& truth) {
  const Tangent6 error = found.change - truth.change;
  // One in a thousand is larger.
  EXPECT_LT(MahalanobisSquare(error, found.covariance), 22.5) << error.transpose();
}

// A creep of every kind of body that is asked for is estimated, and the result is that of the end.
TEST(DriftCalibrationTest, BodiesThatAreListedAreCorrected) {
  struct Case {
    const char* name;
    CellScene scene;
    DriftBody body;
  };
  Case cases[] = {{"camera", FourCameraCell(16), kSecondCamera},
                  {"target", MixedCell(20), {DriftBody::Kind::kTarget, 1}},
                  {"base", TwoArmCell(3), {DriftBody::Kind::kBase, 1}}};
  for (Case& of : cases) {
    const Drift drift = DriftOf(of.body, 2e-3, 0.15);
    AddDrift(drift, &of.scene);
    const CalibrationOptions options = GivenCameras(of.scene);
    const Outcome<Calibration> first = Calibrate(of.scene.problem, options);
    ASSERT_TRUE(first && first->refined) << of.name;
    const std::optional<DriftCalibration> corrected =
        CalibrateWithDrifts(of.scene.problem, *first, options, {false, {of.body}});
    ASSERT_TRUE(corrected) << of.name;
    ASSERT_EQ(corrected->drifts.size(), 1U);
    EXPECT_EQ(corrected->drifts[0].body, of.body);
    ExpectDrift(corrected->drifts[0], drift);
    const CellPoses& poses = corrected->calibration.refined->poses;
    for (size_t c = 0; c < poses.mount_from_camera.size(); ++c) {
      EXPECT_LT(DistanceM(poses.mount_from_camera[c], of.scene.truth.mount_from_camera[c]), 1e-3) << of.name;
    }
    for (size_t t = 0; t < poses.mount_from_target.size(); ++t) {
      EXPECT_LT(DistanceM(poses.mount_from_target[t], of.scene.truth.mount_from_target[t]), 1e-3) << of.name;
    }
    EXPECT_TRUE(corrected->calibration.moved.empty()) << of.name;
    EXPECT_LT(corrected->calibration.refined->pixel_sigmas_px[0], 1.1 * CellSceneSetting().noise_px) << of.name;
  }
}

// A creep is found by itself, whether it looks like a knock or like errors of the camera's images, which rounding may
// decide, and no image is lost.
TEST(DriftCalibrationTest, ACreepOfACameraIsFound) {
  struct Case {
    CellScene scene;
    double translation_m;
    double rotation_deg;
  };
  CellSceneSetting long_session;
  long_session.num_captures = 40;
  Case cases[] = {{MixedCell(20, long_session), 10e-3, 1}, {FourCameraCell(16), 2e-3, 0.15}};
  for (Case& of : cases) {
    const Drift drift = DriftOf(kSecondCamera, of.translation_m, of.rotation_deg);
    AddDrift(drift, &of.scene);
    const CalibrationOptions options = GivenCameras(of.scene);
    const Outcome<Calibration> first = Calibrate(of.scene.problem, options);
    ASSERT_TRUE(first && first->refined);
    const std::optional<DriftCalibration> corrected = CalibrateWithDrifts(of.scene.problem, *first, options, {});
    ASSERT_TRUE(corrected);
    EXPECT_EQ(corrected->drifts[0].evidence, first->moved.empty() ? DriftEvidence::kCameras : DriftEvidence::kMotion);
    ExpectDrift(corrected->drifts[0], drift);
    EXPECT_EQ(NumUsed(corrected->calibration, 1), NumSeen(of.scene, 1));
    EXPECT_LT(
        DistanceM(corrected->calibration.refined->poses.mount_from_camera[1], of.scene.truth.mount_from_camera[1]),
        1e-3);
  }
}

// Images that show a symmetric target the other way round are corrected in the frame of the target as it is read.
TEST(DriftCalibrationTest, ASymmetricTargetMayBeReadInBothOrders) {
  CellScene scene = MixedCell(20);
  const Rigid3d half_turn(ExpRotation({0, 0, kPi}), {0, 0, 0});
  scene.problem.targets[0].symmetries = {Rigid3d(), half_turn};
  const Drift drift = DriftOf(kSecondCamera, 2e-3, 0.15);
  AddDrift(drift, &scene);
  bool is_turned = false;
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.target != 0 || image.camera != kSecondCamera.index) continue;
      is_turned = !is_turned;
      Points3& points = image.observations.points_in_target;
      if (is_turned) points = (half_turn.RotationMatrix() * points).eval();
    }
  }
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> first = Calibrate(scene.problem, options);
  ASSERT_TRUE(first && first->refined);
  const std::optional<DriftCalibration> corrected =
      CalibrateWithDrifts(scene.problem, *first, options, {false, {kSecondCamera}});
  ASSERT_TRUE(corrected);
  ExpectDrift(corrected->drifts[0], drift);
  EXPECT_EQ(NumUsed(corrected->calibration, 1), NumSeen(scene, 1));
}

TEST(DriftCalibrationTest, AKnockStaysAKnock) {
  CellSceneSetting setting;
  setting.num_captures = 24;
  CellScene scene = FourCameraCell(16, setting);
  Drift knock = DriftOf(kSecondCamera, 7e-3, 0.6);
  knock.form = DriftForm::kStep;
  knock.capture = 13;
  AddDrift(knock, &scene);
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> first = Calibrate(scene.problem, options);
  ASSERT_TRUE(first && first->refined);
  ASSERT_EQ(first->moved.size(), 1U);
  EXPECT_FALSE(CalibrateWithDrifts(scene.problem, *first, options, {}));
}

// Neither is a creep found where there is none, nor one estimated of what is not determined.
TEST(DriftCalibrationTest, WhereThereIsNoneNoneIsTaken) {
  CellScene scene = MixedCell(20);
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> first = Calibrate(scene.problem, options);
  ASSERT_TRUE(first && first->refined);
  EXPECT_FALSE(CalibrateWithDrifts(scene.problem, *first, options, {}));
  EXPECT_FALSE(CalibrateWithDrifts(scene.problem, *first, options, {false, {}}));
  const std::optional<DriftCalibration> wanted =
      CalibrateWithDrifts(scene.problem, *first, options, {false, {kSecondCamera}});
  ASSERT_TRUE(wanted);
  ExpectDrift(wanted->drifts[0], DriftOf(kSecondCamera, 0, 0));
  // The pose of the first base is no unknown.
  EXPECT_FALSE(CalibrateWithDrifts(scene.problem, *first, options, {false, {{DriftBody::Kind::kBase, 0}}}));
}

}  // namespace
}  // namespace heba
