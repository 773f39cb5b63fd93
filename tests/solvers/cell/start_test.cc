// The initial guess of a rig: what joins its parts, symmetric targets, and what is refused.
#include "solvers/cell/start.h"

#include <cmath>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/calibration.h"
#include "tests/support/cell_scenes.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {

using testing::HasSubstr;

const Mount kWorld{0, Mount::Part::kBase};
const Mount kGripper{0, Mount::Part::kGripper};

CalibrationOptions GivenCameras(const CellScene& scene) {
  CalibrationOptions options;
  options.has_camera.assign(scene.problem.cameras.size(), true);
  return options;
}

Outcome<CellPoses> StartOf(const CellScene& scene) {
  const CalibrationOptions options = GivenCameras(scene);
  const Outcome<std::vector<Camera>> cameras = EstimateCameras(scene.problem, options);
  if (!cameras) return cameras.failure();
  return JoinPairs(scene.problem, CalibratePairs(scene.problem, options));
}

size_t IndexOf(const CellScene& scene, const std::string& camera) {
  for (size_t c = 0;; ++c) {
    if (scene.problem.cameras.at(c).name == camera) return c;
  }
}

// Expects all cameras and bases, and the targets that have one orientation only, near the truth.
void ExpectNearTruth(const CellScene& scene, const CellPoses& poses, double near_m, double near_rad) {
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    EXPECT_THAT(poses.mount_from_camera[c], IsNearPose(scene.truth.mount_from_camera[c], near_rad, near_m))
        << scene.problem.cameras[c].name;
  }
  for (size_t t = 0; t < scene.problem.targets.size(); ++t) {
    if (scene.problem.targets[t].symmetries.size() > 1) continue;
    EXPECT_THAT(poses.mount_from_target[t], IsNearPose(scene.truth.mount_from_target[t], near_rad, near_m))
        << scene.problem.targets[t].name;
  }
  for (size_t r = 0; r < scene.problem.robots.size(); ++r) {
    EXPECT_THAT(poses.world_from_base[r], IsNearPose(scene.truth.world_from_base[r], near_rad, near_m));
  }
}

// Expects the result of the whole calibration within 2 mm and 0.2 deg of the truth, and all images in use.
void ExpectCalibrates(const CellScene& scene) {
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  ASSERT_TRUE(calibration) << calibration.reason();
  ASSERT_TRUE(calibration->refined) << calibration->refined.reason();
  for (const UnusedProblemImage& unused : calibration->unused) ADD_FAILURE() << unused.capture << " " << unused.reason;
  ExpectNearTruth(scene, calibration->refined->poses, 2e-3, DegToRad(0.2));
}

std::string ReasonOf(const CellScene& scene) {
  const Outcome<Calibration> calibration = Calibrate(scene.problem, GivenCameras(scene));
  return calibration ? "" : calibration.reason();
}

Rigid3d HalfTurn() { return {ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero()}; }

void MakeSymmetric(size_t target, CellScene* scene) {
  scene->problem.targets[target].symmetries = {Rigid3d(), HalfTurn()};
}

// Makes a detector read symmetric targets as it finds them in the image: the first point is above the last one.
void ReadFromTop(CellScene* scene) {
  for (ProblemCapture& capture : scene->problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (scene->problem.targets[image.target].symmetries.size() == 1) continue;
      Observations& seen = image.observations;
      if (seen.pixels(1, 0) < seen.pixels(1, seen.size() - 1)) continue;
      seen.points_in_target = (HalfTurn().RotationMatrix() * seen.points_in_target).eval();
    }
  }
}

// Removes the images of a camera and a target but the first `num_kept`.
void KeepImages(size_t camera, size_t target, int num_kept, CellScene* scene) {
  for (ProblemCapture& capture : scene->problem.captures) {
    std::erase_if(capture.images, [&](const ProblemImage& image) {
      return image.camera == camera && image.target == target && num_kept-- <= 0;
    });
  }
}

int NumImages(const CellScene& scene, size_t camera, size_t target) {
  int num_images = 0;
  for (const ProblemCapture& capture : scene.problem.captures) {
    for (const ProblemImage& image : capture.images) num_images += image.camera == camera && image.target == target;
  }
  return num_images;
}

CellSceneSetting HeldCameras() {
  CellSceneSetting setting;
  setting.has_free_intrinsics = false;
  setting.num_captures = 30;
  return setting;
}

// A camera on the gripper and the fixed camera `left`, both of which see the symmetric fixed target `wall`. Another
// fixed target for all cameras on the gripper, if any.
void AddWristAndWall(double left_roll_rad, CellScene* scene) {
  scene->problem.robots = {"arm"};
  scene->truth.world_from_base = {Rigid3d()};
  const Eigen::Vector3d wall(0.6, 0, 0.2);
  AddCamera("wrist", kGripper, Rigid3d(ExpRotation({0.1, -0.1, 1.5}), {0.06, 0, 0.04}), HeldCameras(), scene);
  AddCamera("left", kWorld, LookingAt({0.55, 0.05, 0.9}, wall, 0.1 + left_roll_rad), HeldCameras(), scene);
  // The camera looks at the front of a target along its z axis.
  AddTarget("wall", kWorld, Rigid3d(ExpRotation({kPi, 0, 0}), wall), scene);
}

CellScene WallCell(double left_roll_rad) {
  CellScene scene;
  AddWristAndWall(left_roll_rad, &scene);
  Rng rng(21);
  Simulate(HeldCameras(), rng, &scene);
  MakeSymmetric(0, &scene);
  ReadFromTop(&scene);
  return scene;
}

// Likewise, with a plate on the gripper, which `left` sees in two captures and, if it is there, `right` in many.
CellScene WallAndPlateCell(double left_roll_rad, bool has_right, bool has_symmetric_plate) {
  CellScene scene;
  AddWristAndWall(left_roll_rad, &scene);
  if (has_right) {
    AddCamera("right", kWorld, LookingAt({0.5, 0.6, 0.7}, {0.5, 0, 0.4}, 0.4), HeldCameras(), &scene);
  }
  AddTarget("plate", kGripper, Rigid3d(ExpRotation({1.2, 0.3, -0.4}), {0, -0.05, 0.08}), &scene);
  CellSceneSetting setting = HeldCameras();
  setting.num_captures = 40;
  Rng rng(22);
  Simulate(setting, rng, &scene);
  KeepImages(IndexOf(scene, "left"), 1, 2, &scene);
  EXPECT_EQ(NumImages(scene, IndexOf(scene, "left"), 1), 2);
  MakeSymmetric(0, &scene);
  if (has_symmetric_plate) MakeSymmetric(1, &scene);
  ReadFromTop(&scene);
  return scene;
}

TEST(CellStart, RefusesACameraThatASymmetricTargetAtRestAloneJoins) {
  for (const double roll_rad : {0.0, kPi}) {
    const CellScene scene = WallCell(roll_rad);
    ASSERT_EQ(NumImages(scene, 1, 0), 30);
    EXPECT_EQ(ReasonOf(scene), "ambiguous_part (poses 2, symmetries 2, part camera left, target wall)");
  }
}

TEST(CellStart, JoinsACameraByATargetAtRestThatIsNotSymmetric) {
  for (const double roll_rad : {0.0, kPi}) {
    CellScene scene;
    AddWristAndWall(roll_rad, &scene);
    Rng rng(23);
    Simulate(HeldCameras(), rng, &scene);
    ExpectCalibrates(scene);
  }
}

// Two images of a target whose pose is known from another camera.
TEST(CellStartNightly, ReadsASymmetricTargetInTheOrderThatImagesOfAnotherTargetDecide) {
  for (const double roll_rad : {0.0, kPi}) {
    for (const bool has_symmetric_plate : {false, true}) {
      ExpectCalibrates(WallAndPlateCell(roll_rad, true, has_symmetric_plate));
    }
  }
}

// Two images of a target whose pose nothing else tells: each orientation of the wall gives another pose of the plate,
// and one of them has the same pose of the plate in both images.
TEST(CellStart, ReadsASymmetricTargetInTheOrderThatALoopDecides) {
  for (const double roll_rad : {0.0, kPi}) {
    for (const bool has_symmetric_plate : {false, true}) {
      ExpectCalibrates(WallAndPlateCell(roll_rad, false, has_symmetric_plate));
    }
  }
}

TEST(CellStart, RefusesAnArmThatASymmetricTargetAtRestAloneJoins) {
  for (const bool is_symmetric : {true, false}) {
    CellScene scene;
    scene.problem.robots = {"left", "right"};
    scene.truth.world_from_base = {Rigid3d(), Rigid3d(ExpRotation({0.05, -0.02, 3.0}), {1.1, 0.1, 0.02})};
    for (size_t r = 0; r < 2; ++r) {
      AddCamera(r == 0 ? "first" : "second", {r, Mount::Part::kGripper},
                Rigid3d(ExpRotation({0.1, -0.1, 1.5}), {0.06, 0, 0.04}), HeldCameras(), &scene);
    }
    AddTarget("wall", kWorld, Rigid3d(ExpRotation({kPi, 0, 0}), {0.6, 0, 0.2}), &scene);
    Rng rng(24);
    Simulate(HeldCameras(), rng, &scene);
    if (is_symmetric) MakeSymmetric(0, &scene);
    ReadFromTop(&scene);
    if (is_symmetric) {
      EXPECT_THAT(ReasonOf(scene), HasSubstr("ambiguous_part (poses 2, symmetries 2, part arm right, target wall)"));
    } else {
      ExpectCalibrates(scene);
    }
  }
}

TEST(CellStart, JoinsACameraByFewImagesOfATargetThatIsKnown) {
  for (const int num_images : {1, 2}) {
    CellScene scene = MixedCell(25, HeldCameras());
    const size_t right = IndexOf(scene, "right");
    KeepImages(right, 0, num_images, &scene);
    KeepImages(right, 1, 0, &scene);
    ASSERT_EQ(NumImages(scene, right, 0), num_images);
    ExpectCalibrates(scene);
  }
}

TEST(CellStart, RefusesACameraWithOneImageOfASymmetricTarget) {
  for (const int num_images : {1, 2}) {
    CellScene scene = MixedCell(26, HeldCameras());
    const size_t right = IndexOf(scene, "right");
    KeepImages(right, 0, num_images, &scene);
    KeepImages(right, 1, 0, &scene);
    MakeSymmetric(0, &scene);
    ReadFromTop(&scene);
    if (num_images == 1) {
      EXPECT_THAT(ReasonOf(scene),
                  HasSubstr("ambiguous_part (poses 2, symmetries 2, part camera right, target plate)"));
    } else {
      ExpectCalibrates(scene);
    }
  }
}

TEST(CellStart, RefusesACameraWhoseImagesHaveTooFewPoints) {
  CellScene scene = MixedCell(27, HeldCameras());
  const size_t right = IndexOf(scene, "right");
  KeepImages(right, 0, 1, &scene);
  KeepImages(right, 1, 0, &scene);
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.camera != right) continue;
      image.observations.ids.resize(3);
      image.observations.pixels.conservativeResize(Eigen::NoChange, 3);
      image.observations.points_in_target.conservativeResize(Eigen::NoChange, 3);
    }
  }
  EXPECT_EQ(ReasonOf(scene), "pair_without_pose (images 1, camera right, target plate, part camera right)");
}

// A camera on the gripper of one arm that sees the target on that of the other, with both arms joined by a fixed
// camera.
TEST(CellStart, JoinsACameraOnOneArmByATargetOnTheOther) {
  const CellSceneSetting setting = HeldCameras();
  CellScene scene = TwoArmCell(28, setting);
  const size_t hand = scene.problem.cameras.size();
  const Mount right_gripper{1, Mount::Part::kGripper};
  const auto world_from_plate = [&](size_t capture) {
    return WorldFromMount(scene.problem.targets[0].mount, scene.truth.world_from_base, scene.arms[capture]) *
           scene.truth.mount_from_target[0];
  };
  // It sees the front of the plate in the first capture.
  const Rigid3d plate = world_from_plate(0);
  const Rigid3d world_from_hand = LookingAt(plate * Eigen::Vector3d(0.2, 0.1, -0.7), plate.translation, 0.3);
  const Rigid3d world_from_gripper = WorldFromMount(right_gripper, scene.truth.world_from_base, scene.arms[0]);
  AddCamera("hand", right_gripper, Inverse(world_from_gripper) * world_from_hand, setting, &scene);
  Rng rng(29);
  for (size_t i = 0; i < scene.arms.size(); ++i) {
    const Rigid3d camera_from_target = CameraFromTarget(scene.problem, scene.truth, hand, 0, scene.arms[i]);
    if (!IsVisible(scene.problem.cameras[hand].camera, camera_from_target, scene.targets[0], 10)) continue;
    scene.problem.captures[i].images.push_back(
        {hand, 0,
         SimulateView("", scene.problem.cameras[hand].camera, {}, camera_from_target, scene.targets[0].points_in_target,
                      setting.noise_px, rng)
             ->observations});
  }
  ASSERT_GE(NumImages(scene, hand, 0), 1);
  ExpectCalibrates(scene);
  // Without the fixed camera's images of the disk, the right arm is joined by nothing.
  KeepImages(0, 1, 0, &scene);
  scene.problem.targets.pop_back();
  scene.targets.pop_back();
  scene.truth.mount_from_target.pop_back();
  EXPECT_THAT(ReasonOf(scene), HasSubstr("camera hand, target plate): on_two_arms"));
}

// A fixed camera and a fixed target: one image has four points close together, which any pose fits well, and others
// belong elsewhere.
TEST(CellStart, PlacesATargetAtRestByTheImagesThatDetermineItBest) {
  CellScene scene;
  AddWristAndWall(0, &scene);
  Rng rng(30);
  Simulate(HeldCameras(), rng, &scene);
  const size_t left = IndexOf(scene, "left");
  int num_seen = 0;
  for (ProblemCapture& capture : scene.problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (image.camera != left) continue;
      ++num_seen;
      Observations& seen = image.observations;
      if (num_seen <= 3) {
        // Another camera position: the image is consistent with itself.
        Tangent6 knock;
        knock << 0.1, 0.02, 0, 0.05, 0.1, 0.05;
        const Rigid3d camera_from_target =
            Retract(CameraFromTarget(scene.problem, scene.truth, left, 0, scene.arms[0]), knock);
        seen = SimulateView("", scene.problem.cameras[left].camera, {}, camera_from_target,
                            scene.targets[0].points_in_target, 0, rng)
                   ->observations;
      } else if (num_seen % 5 == 0) {
        const std::vector<int> corner = {0, 1, 8, 9};
        Observations few;
        few.pixels.resize(2, 4);
        few.points_in_target.resize(3, 4);
        for (size_t k = 0; k < corner.size(); ++k) {
          few.ids.push_back(seen.ids.at(static_cast<size_t>(corner[k])));
          few.pixels.col(static_cast<Eigen::Index>(k)) = seen.pixels.col(corner[k]);
          few.points_in_target.col(static_cast<Eigen::Index>(k)) = seen.points_in_target.col(corner[k]);
        }
        seen = few;
      }
    }
  }
  ASSERT_EQ(num_seen, 30);
  const Outcome<CellPoses> start = StartOf(scene);
  ASSERT_TRUE(start) << start.reason();
  ExpectNearTruth(scene, *start, 2e-3, DegToRad(0.2));
}

TEST(CellStart, NamesTheTargetThatNoCameraSaw) {
  CellScene scene = MixedCell(31);
  AddTarget("ghost", kWorld, Rigid3d(), &scene);
  EXPECT_EQ(ReasonOf(scene), "unseen_target (target ghost)");
}

TEST(CellStart, NamesTheCameraThatSawNoTarget) {
  CellScene scene = MixedCell(32);
  AddCamera("blind", kWorld, Rigid3d(), HeldCameras(), &scene);
  EXPECT_EQ(ReasonOf(scene), "camera_without_target (camera blind, target plate, target wall)");
}

// Two arms, each with a fixed camera that sees its target only.
TEST(CellStart, NamesTheImagesThatWouldJoinAnArm) {
  const CellSceneSetting setting = HeldCameras();
  CellScene scene = TwoArmCell(33, setting);
  AddCamera("side", {1, Mount::Part::kBase}, LookingAt({0.5, 0.6, 0.7}, {0.5, 0, 0.4}, 0.2), setting, &scene);
  Rng rng(34);
  Simulate(setting, rng, &scene);
  KeepImages(0, 1, 0, &scene);
  KeepImages(1, 0, 0, &scene);
  EXPECT_EQ(ReasonOf(scene),
            "not_joined (part camera side, part arm right, of_camera top, of_target disk, of_camera side, of_target "
            "plate)");
}

}  // namespace
}  // namespace heba
