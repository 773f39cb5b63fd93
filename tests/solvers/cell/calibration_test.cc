#include "heba/calibration.h"
#include "heba/cross_validation.h"
#include "heba/pair_calibration.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "solvers/calibration/scale_share.h"
#include "solvers/residuals/inliers.h"
#include "tests/support/cell_scenes.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {

CalibrationOptions GivenCameras(const CellScene& scene) {
  CalibrationOptions options;
  options.has_camera.assign(scene.problem.cameras.size(), true);
  return options;
}

// Expects all poses within 2 mm and 0.2 deg of the truth: some 10 sigmas.
void ExpectTruth(const CellScene& scene, const Solution& solution) {
  constexpr double kNearM = 2e-3;
  const double near_rad = DegToRad(0.2);
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    EXPECT_THAT(solution.poses.mount_from_camera[c], IsNearPose(scene.truth.mount_from_camera[c], near_rad, kNearM));
  }
  for (size_t t = 0; t < scene.problem.targets.size(); ++t) {
    EXPECT_THAT(solution.poses.mount_from_target[t], IsNearPose(scene.truth.mount_from_target[t], near_rad, kNearM));
  }
  for (size_t r = 0; r < scene.problem.robots.size(); ++r) {
    EXPECT_THAT(solution.poses.world_from_base[r], IsNearPose(scene.truth.world_from_base[r], near_rad, kNearM));
  }
}

// Returns the first image of a camera at or after this capture.
ProblemImage& ImageOf(CellScene& scene, size_t camera, size_t* capture) {
  for (;; ++*capture) {
    for (ProblemImage& image : scene.problem.captures.at(*capture).images) {
      if (image.camera == camera) return image;
    }
  }
}

TEST(Calibration, FindsEveryCellFromItsImages) {
  for (const CellScene& scene : {MixedCell(1), FourCameraCell(2), TwoArmCell(3)}) {
    const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
    ASSERT_TRUE(calibration) << calibration.reason();
    ASSERT_TRUE(calibration->refined) << calibration->refined.reason();
    for (const UnusedProblemImage& unused : calibration->unused)
      ADD_FAILURE() << unused.capture << " " << unused.reason;
    ExpectTruth(scene, *calibration->refined);
  }
}

TEST(Calibration, EstimatesCamerasThatAreNotGiven) {
  CellScene scene = MixedCell(6, {40, 0.1, {0.1e-3, DegToRad(0.02), 0}});
  for (ProblemCamera& camera : scene.problem.cameras) {
    camera.camera.params.clear();
    camera.camera.model.clear();
  }
  const Outcome<Calibration> calibration = Calibrate(scene.problem, CalibrationOptions());
  ASSERT_TRUE(calibration) << calibration.reason();
  ASSERT_TRUE(calibration->refined) << calibration->refined.reason();
  ExpectTruth(scene, *calibration->refined);
}

TEST(Calibration, NamesTheImageThatContradictsTheOthers) {
  CellScene scene = FourCameraCell(5);
  size_t wrong = 7;
  ProblemImage& image = ImageOf(scene, 2, &wrong);
  size_t other = wrong + 1;
  // The image of another capture.
  image.observations = ImageOf(scene, 2, &other).observations;
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined);
  ASSERT_EQ(calibration->unused.size(), 1U);
  const UnusedProblemImage& unused = calibration->unused.front();
  EXPECT_EQ(unused.capture, wrong);
  ASSERT_TRUE(unused.image.has_value());
  EXPECT_EQ(scene.problem.captures[wrong].images[*unused.image].camera, 2U);
  ExpectTruth(scene, *calibration->refined);
}

// An image of a camera that was knocked by 3 mm and 0.3 deg for one capture is found although the robot noise could
// explain it if it were alone.
TEST(Calibration, NamesTheImageThatDeviatesByLittle) {
  CellSceneSetting setting;
  setting.robot_noise = {1e-3, DegToRad(0.1), 0};
  CellScene scene = FourCameraCell(6, setting);
  size_t wrong = 4;
  ProblemImage& image = ImageOf(scene, 1, &wrong);
  Tangent6 knock;
  knock << 3e-3, 0, 0, 0, 0, DegToRad(0.3);
  CellPoses knocked = scene.truth;
  knocked.mount_from_camera[1] = Retract(knocked.mount_from_camera[1], knock);
  const Rigid3d camera_from_target = CameraFromTarget(scene.problem, knocked, 1, 0, scene.arms[wrong]);
  Rng rng(9);
  image.observations = SimulateView("", scene.problem.cameras[1].camera, {}, camera_from_target,
                                    scene.targets[0].points_in_target, setting.noise_px, rng)
                           ->observations;
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined);
  ASSERT_EQ(calibration->unused.size(), 1U);
  EXPECT_EQ(calibration->unused.front().capture, wrong);
  EXPECT_EQ(scene.problem.captures[wrong].images[calibration->unused.front().image.value_or(99)].camera, 1U);
}

TEST(Calibration, NamesTheCaptureWithAWrongPose) {
  CellScene scene = FourCameraCell(7);
  Tangent6 step;
  step << 0.02, 0.01, 0, 0, 0.03, 0;
  Rigid3d& pose = scene.problem.captures[11].base_from_gripper[0];
  pose = Retract(pose, step);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined);
  ASSERT_EQ(calibration->unused.size(), 1U);
  EXPECT_EQ(calibration->unused.front().capture, 11U);
  EXPECT_FALSE(calibration->unused.front().image.has_value());
  EXPECT_NE(calibration->unused.front().reason.find("arm"), std::string::npos);
  ExpectTruth(scene, *calibration->refined);
}

TEST(Calibration, FreesTheShapeOfTheTargetThatDiffersFromItsDesign) {
  CellScene scene = MixedCell(8, {40, 0.1, {0.1e-3, DegToRad(0.02), 0}});
  // The plate was printed 1 % too large; its design is what the observations hold.
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.target == 0) image.observations.points_in_target /= 1.01;
    }
  }
  scene.problem.targets[0].shape = DesignedShape(scene.targets[0].points_in_target / 1.01);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration->refined.reason();
  EXPECT_EQ(calibration->problem.targets[0].free_shape, std::vector{TargetShapeGroup::kScale});
  EXPECT_TRUE(calibration->problem.targets[1].free_shape.empty());
  EXPECT_NEAR(calibration->refined->shapes[0].params[0], 1.01, 2e-4);
}

TEST(Calibration, ReadsSymmetricTargetsInOneOrder) {
  CellScene scene = FourCameraCell(10);
  const Rigid3d half_turn(ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero());
  scene.problem.targets[0].symmetries = {Rigid3d(), half_turn};
  Rng rng(3);
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (rng.Uniform() < 0.5) continue;
      image.observations.points_in_target = (half_turn.RotationMatrix() * image.observations.points_in_target).eval();
    }
  }
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  EXPECT_TRUE(calibration->unused.empty());
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_THAT(calibration->refined->poses.mount_from_camera[c],
                IsNearPose(scene.truth.mount_from_camera[c], DegToRad(0.2), 2e-3));
  }
}

TEST(Calibration, JoinsACameraByATargetAtRest) {
  CellScene scene = MixedCell(11);
  // A camera that sees only the fixed target, and never moves.
  const Eigen::Vector3d wall = scene.truth.mount_from_target[1].translation;
  const Eigen::Vector3d front = scene.truth.mount_from_target[1].rotation * Eigen::Vector3d(0.2, 0.1, -0.8);
  CellSceneSetting setting;
  setting.has_free_intrinsics = false;
  AddCamera("corner", {0, Mount::Part::kBase}, LookingAt(wall + front, wall, 0.3), setting, &scene);
  const size_t camera = scene.problem.cameras.size() - 1;
  Rng rng(12);
  for (size_t i = 0; i < scene.arms.size(); ++i) {
    const Rigid3d camera_from_target = CameraFromTarget(scene.problem, scene.truth, camera, 1, scene.arms[i]);
    scene.problem.captures[i].images.push_back(
        {camera, 1,
         SimulateView("", scene.problem.cameras[camera].camera, {}, camera_from_target,
                      scene.targets[1].points_in_target, 0.1, rng)
             ->observations});
  }
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  ExpectTruth(scene, *calibration->refined);
}

TEST(Calibration, PredictsHeldOutCaptures) {
  CellSceneSetting setting;
  setting.num_captures = 40;
  const CellScene scene = FourCameraCell(14, setting);
  CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, options);
  ASSERT_TRUE(calibration && calibration->refined);
  int num_folds = 0;
  const HoldOuts errors = CrossValidate(*calibration, options, 5, [&] { ++num_folds; });
  EXPECT_EQ(num_folds, 5);
  ASSERT_TRUE(errors.chi2_per_dof.has_value());
  // 1 within four standard deviations for the number of measured coordinates.
  int num_points = 0;
  for (const ProblemCapture& capture : scene.problem.captures) {
    for (const ProblemImage& image : capture.images) num_points += image.observations.size();
  }
  EXPECT_NEAR(*errors.chi2_per_dof, 1, 4 / std::sqrt(static_cast<double>(num_points)));
  for (const CameraHoldOut& camera : errors.of_cameras) {
    ASSERT_TRUE(camera.rms_px && camera.target_m && camera.target_rad) << camera.reason.ToString();
    // Pixels and robot: 0.1 mm at 0.7 m are 0.2 px, 0.02 deg of the gripper about as much.
    EXPECT_GT(*camera.rms_px, 0.15);
    EXPECT_LT(*camera.rms_px, 0.8);
    EXPECT_LT(*camera.target_m, 1e-3);
  }
}

// Whether the shifted images of the camera fail by themselves, contradict each other in part, or agree with noise of a
// hundred pixels, depends on the scene.
TEST(Calibration, NamesTheCameraWhoseImagesAreShifted) {
  for (const uint64_t seed : {15, 16, 18}) {
    CellScene scene = FourCameraCell(seed);
    // The images of the third camera belong to the capture before.
    std::vector<ProblemImage> last;
    for (ProblemCapture& capture : scene.problem.captures) {
      std::vector<ProblemImage> own;
      for (const ProblemImage& image : capture.images) {
        if (image.camera == 2) own.push_back(image);
      }
      std::erase_if(capture.images, [](const ProblemImage& image) { return image.camera == 2; });
      capture.images.insert(capture.images.end(), last.begin(), last.end());
      last = own;
    }
    const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
    ASSERT_FALSE(calibration) << seed;
    EXPECT_EQ(calibration.reason(), "shifted_images (shift -1, camera camera3)") << seed;
  }
}

// Moves a camera from a capture on.
void Move(size_t camera, size_t first_capture, const Tangent6& motion, CellScene* scene) {
  CellPoses moved = scene->truth;
  moved.mount_from_camera[camera] = Retract(moved.mount_from_camera[camera], motion);
  Rng rng(17);
  for (size_t i = first_capture; i < scene->problem.captures.size(); ++i) {
    for (ProblemImage& image : scene->problem.captures[i].images) {
      if (image.camera != camera) continue;
      const Rigid3d camera_from_target = CameraFromTarget(scene->problem, moved, camera, image.target, scene->arms[i]);
      image.observations = SimulateView("", scene->problem.cameras[camera].camera, {}, camera_from_target,
                                        scene->targets[image.target].points_in_target, CellSceneSetting().noise_px, rng)
                               ->observations;
    }
  }
}

bool Sees(const ProblemCapture& capture, size_t camera) {
  return std::any_of(capture.images.begin(), capture.images.end(),
                     [&](const ProblemImage& image) { return image.camera == camera; });
}

// These functions return the last capture before `capture`, and the first one from it on, of which a camera has an
// image.
size_t LastSeen(const Problem& problem, size_t camera, size_t capture) {
  do {
    --capture;
  } while (!Sees(problem.captures[capture], camera));
  return capture;
}
size_t FirstSeen(const Problem& problem, size_t camera, size_t capture) {
  while (!Sees(problem.captures[capture], camera)) ++capture;
  return capture;
}

TEST(Calibration, NamesTheCameraThatWasMoved) {
  CellSceneSetting setting;
  setting.num_captures = 30;
  CellScene scene = FourCameraCell(16, setting);
  Tangent6 motion;
  motion << 4e-3, 0, 0, 0, DegToRad(0.5), 0;
  Move(1, 20, motion, &scene);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  const std::vector<Finding> findings = DiagnoseCalibration(scene.problem, *calibration);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings.front().code, "camera_moved");
  EXPECT_EQ(findings.front().Name("camera"), "camera2");
  EXPECT_EQ(findings.front().Name("first_capture"), "capture_20");
  EXPECT_NEAR(*findings.front().Number("moved_mm"), 4, 1);
  EXPECT_NEAR(*findings.front().Number("moved_deg"), 0.5, 0.1);
  // All images of the camera after the motion are left out.
  int num_after = 0;
  for (size_t i = 20; i < scene.problem.captures.size(); ++i) {
    num_after += Sees(scene.problem.captures[i], 1) ? 1 : 0;
  }
  EXPECT_EQ(*findings.front().Number("images_left_out"), num_after);
  EXPECT_EQ(findings.front().Name("first_left_out"), "capture_20");
  ExpectTruth(scene, *calibration->refined);
}

// Half of the images contradict the other half, so that none is an outlier; the noise of the images could explain all.
TEST(Calibration, NamesTheCameraThatWasMovedALittleAtHalfOfTheCaptures) {
  CellSceneSetting setting;
  setting.num_captures = 30;
  CellScene scene = MixedCell(20, setting);
  Tangent6 motion;
  motion << 0.5e-3, 0, 0, 0, DegToRad(0.1), 0;
  Move(0, 15, motion, &scene);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  ASSERT_EQ(calibration->moved.size(), 1U);
  const MovedCamera& moved = calibration->moved.front();
  EXPECT_EQ(moved.camera, 0U);
  EXPECT_EQ(moved.last_capture, LastSeen(scene.problem, 0, 15));
  EXPECT_EQ(moved.first_capture, FirstSeen(scene.problem, 0, 15));
  EXPECT_LT(DistanceM(moved.before_from_after, Retract(Rigid3d(), motion)), 0.2e-3);
  EXPECT_LT(AngleRad(moved.before_from_after, Retract(Rigid3d(), motion)), DegToRad(0.03));
  for (size_t i = 0; i < 15; ++i) {
    for (const ProblemImage& image : calibration->problem.captures[i].images) {
      EXPECT_GT(image.observations.size(), 0) << "capture " << i << ", camera " << image.camera;
    }
  }
}

// One point of an image after the motion is read, and rejected: the image says nothing about where the camera stands.
TEST(Calibration, NamesTheMovedCameraInSpiteOfAStrayPoint) {
  CellSceneSetting setting;
  setting.num_captures = 24;
  CellScene scene = MixedCell(19, setting);
  Tangent6 knock;
  knock << 0, 0, 0, DegToRad(1.5), DegToRad(1.0), 0;
  // The camera is moved after the first ten captures.
  Move(0, 10, knock, &scene);
  // One image on either side has a single point far off.
  for (const size_t capture : {3, 20}) {
    ProblemImage stray;
    stray.camera = 0;
    stray.target = 1;
    stray.observations.ids = {5};
    stray.observations.points_in_target = scene.targets[1].points_in_target.col(5);
    stray.observations.pixels = Points2::Constant(2, 1, 40);
    std::erase_if(scene.problem.captures[capture].images,
                  [](const ProblemImage& image) { return image.camera == 0 && image.target == 1; });
    scene.problem.captures[capture].images.push_back(stray);
  }
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  const std::vector<Finding> findings = DiagnoseCalibration(scene.problem, *calibration);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings.front().code, "camera_moved");
  EXPECT_EQ(findings.front().Name("camera"), "left");
  const std::vector<ProblemCapture>& captures = scene.problem.captures;
  EXPECT_EQ(findings.front().Name("last_capture"), captures[LastSeen(scene.problem, 0, 10)].name);
  EXPECT_EQ(findings.front().Name("first_capture"), captures[FirstSeen(scene.problem, 0, 10)].name);
}

// A camera that has images in one fold only cannot be held out; the other cameras have their figures.
TEST(Calibration, HoldsOutTheCamerasThatTheOthersDetermine) {
  CellSceneSetting setting;
  setting.has_free_intrinsics = false;
  CellScene scene = FourCameraCell(21, setting);
  for (size_t i = 0; i < scene.problem.captures.size(); ++i) {
    if (i % 5 == 2) continue;
    std::erase_if(scene.problem.captures[i].images, [](const ProblemImage& image) { return image.camera == 3; });
  }
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, options);
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  const HoldOuts errors = CrossValidate(*calibration, options, 5, [] {});
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_TRUE(errors.of_cameras[c].rms_px && errors.of_cameras[c].target_m) << errors.of_cameras[c].reason.ToString();
    EXPECT_TRUE(errors.of_cameras[c].reason.empty());
  }
  EXPECT_FALSE(errors.of_cameras[3].rms_px || errors.of_cameras[3].target_m);
  EXPECT_EQ(errors.of_cameras[3].reason.ToString().find("of_fold (fold 3): no_information (unknown cameras.camera4."),
            0U)
      << errors.of_cameras[3].reason.ToString();
  EXPECT_TRUE(errors.chi2_per_dof.has_value());
}

// Returns the findings about the scales of targets that were printed as designed, by robots of exact lengths.
std::vector<Finding> ScalesOf(const Calibration& calibration) {
  const Problem& problem = calibration.problem;
  return ShareOfScales(WithoutRejected(problem, *calibration.refined), *calibration.refined,
                       {std::vector<double>(problem.targets.size(), 0), std::vector<double>(problem.robots.size(), 0)})
      .findings;
}

TEST(Calibration, NamesTheTargetOfAWrongSize) {
  CellScene scene = MixedCell(18, {40, 0.1, {0.1e-3, DegToRad(0.02), 0}});
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.target == 1) image.observations.points_in_target *= 1.1;
    }
  }
  scene.problem.targets[1].shape = DesignedShape(1.1 * scene.targets[1].points_in_target);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  const std::vector<Finding> findings = ScalesOf(*calibration);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings.front().code, "target_scale");
  EXPECT_EQ(findings.front().Name("of_target"), "wall");
  EXPECT_NEAR(*findings.front().Number("scale_x"), 1 / 1.1, 1e-3);
}

// A target at rest that only a camera at rest sees has a size that no image tells; that of the others is told all the
// same.
TEST(Calibration, NamesTheTargetOfAWrongSizeBesideOneOfUnknownSize) {
  CellScene scene = MixedCell(19, {40, 0.1, {0.1e-3, DegToRad(0.02), 0}});
  scene.problem.cameras.pop_back();
  scene.truth.mount_from_camera.pop_back();
  for (ProblemCapture& capture : scene.problem.captures) {
    std::erase_if(capture.images, [](const ProblemImage& image) { return image.camera == 2; });
    for (ProblemImage& image : capture.images) {
      if (image.target == 0) image.observations.points_in_target *= 1.01;
    }
  }
  scene.problem.targets[0].shape = DesignedShape(1.01 * scene.targets[0].points_in_target);
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
  EXPECT_TRUE(calibration->problem.targets[1].free_shape.empty());
  const std::vector<Finding> findings = ScalesOf(*calibration);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings.front().Name("of_target"), "plate");
  EXPECT_NEAR(*findings.front().Number("scale_x"), 1 / 1.01, 2e-4);
}

TEST(CalibrationNightly, NamesTheCameraWhoseHeldIntrinsicsAreWrong) {
  CellSceneSetting setting;
  setting.has_free_intrinsics = false;
  CellScene scene = MixedCell(22, setting);
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<Calibration> good = Calibrate(scene.problem, options);
  ASSERT_TRUE(good && good->refined) << good.reason();
  EXPECT_TRUE(DiagnoseHeldIntrinsics(scene.problem, *good, options.adjustment).findings.empty());
  for (const size_t i : {0, 1}) scene.problem.cameras[1].camera.params[i] *= 1.02;
  const Outcome<Calibration> wrong = Calibrate(scene.problem, options);
  ASSERT_TRUE(wrong && wrong->refined) << wrong.reason();
  const Advice advice = DiagnoseHeldIntrinsics(scene.problem, *wrong, options.adjustment);
  const std::vector<Finding>& findings = advice.findings;
  ASSERT_FALSE(findings.empty());
  ASSERT_EQ(advice.changes.size(), findings.size());
  const auto worst = std::min_element(findings.begin(), findings.end(), [](const Finding& a, const Finding& b) {
    return *a.Number("p") < *b.Number("p");
  });
  EXPECT_EQ(worst->code, "held_intrinsics");
  EXPECT_EQ(worst->Name("of_camera"), "right");
  // With the change, the sigmas cover what the wrong camera does to its pose, up to the noise of the freed estimate.
  Solution widened = *wrong->refined;
  widened.covariance = WithChanges(widened.covariance, {advice.changes[static_cast<size_t>(worst - findings.begin())]});
  const auto squared_sigmas_off = [&](const Solution& solution) {
    const Tangent6 error = LocalCoordinates(solution.poses.mount_from_camera[1], scene.truth.mount_from_camera[1]);
    return MahalanobisSquare(error, *PoseCovarianceOf(solution.covariance, CameraPoseBlock(scene.problem.cameras[1])));
  };
  EXPECT_LT(squared_sigmas_off(widened), 0.1 * squared_sigmas_off(*wrong->refined));
}

TEST(Calibration, NamesWhatNoImageJoins) {
  CellScene scene = TwoArmCell(13);
  for (ProblemCapture& capture : scene.problem.captures) {
    std::erase_if(capture.images, [](const ProblemImage& image) { return image.target == 1; });
  }
  scene.problem.targets.pop_back();
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_FALSE(calibration);
  EXPECT_EQ(calibration.reason(), "arm_carries_nothing (arms 2, arm right, mount right.gripper)");
}

}  // namespace
}  // namespace heba
