#include "tools/run/reached_accuracy.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "heba/data/prediction.h"
#include "heba/location.h"
#include "heba/refinement.h"
#include "tests/support/cell_scenes.h"

namespace heba {
namespace {

// A place in the middle of the cell, in view of the cameras left and right.
const Eigen::Vector3d kPlace(0.5, 0.0, 0.4);

std::vector<CameraRequirement> ReachedBy(const CellScene& scene, const Solution& solution,
                                         const PlacedRequirement& required) {
  return ReachedAccuracies({required}, scene.problem, solution, WorkingPointsOf(scene.problem, solution, {}));
}

std::vector<size_t> CamerasOf(const std::vector<CameraRequirement>& all) {
  std::vector<size_t> cameras;
  for (const CameraRequirement& entry : all) cameras.push_back(entry.camera);
  std::sort(cameras.begin(), cameras.end());
  return cameras;
}

// The error of the position that a camera gives a target at `place`, if its image is exact.
double ErrorM(const CellScene& scene, const Solution& solution, size_t camera, const Eigen::Vector3d& place) {
  const Rigid3d& truth = scene.truth.mount_from_camera[camera];
  const Camera& lens = scene.problem.cameras[camera].camera;
  Observations seen;
  seen.points_in_target = GridPoints(8, 6, 0.02);
  for (int i = 0; i < seen.points_in_target.cols(); ++i) seen.ids.push_back(i);
  const Eigen::Vector3d middle = seen.points_in_target.rowwise().mean();
  Rigid3d camera_from_target(ExpRotation({0.3, 0.2, 0.1}), Eigen::Vector3d::Zero());
  camera_from_target.translation = Inverse(truth) * place - camera_from_target * middle;
  CHECK(Predict(lens.Model(), lens.params.data(), camera_from_target, seen, &seen.pixels, nullptr));
  const Outcome<LocatedTarget> located = LocateInCell(scene.problem, solution, {{camera, seen}}, {Rigid3d()});
  CHECK(located.ok()) << located.reason();
  return (located->world_from_target * middle - place).norm();
}

// With its confidence, the radius that is reached holds the error at the place.
void ExpectRadiusHolds(int num_trials) {
  PlacedRequirement required;
  required.confidence = 0.8;
  required.places_in_base_m = {kPlace};
  required.text = "the middle";
  required.camera = "camera1";
  int num_inside = 0;
  for (int seed = 1; seed <= num_trials; ++seed) {
    const CellScene scene = FourCameraCell(static_cast<uint64_t>(seed), {20});
    const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
    ASSERT_TRUE(solution) << solution.reason();
    const std::vector<CameraRequirement> reached = ReachedBy(scene, *solution, required);
    ASSERT_EQ(reached.size(), 1U);
    EXPECT_EQ(reached[0].camera, 0U);
    EXPECT_EQ(reached[0].requirement.place, "the middle");
    ASSERT_TRUE(reached[0].requirement.reached_m.has_value());
    num_inside += ErrorM(scene, *solution, 0, kPlace) <= *reached[0].requirement.reached_m ? 1 : 0;
  }
  // Three standard deviations of the share.
  EXPECT_NEAR(num_inside / static_cast<double>(num_trials), 0.8, 3 * std::sqrt(0.8 * 0.2 / num_trials));
}

TEST(ReachedAccuracyTest, TheRadiusHoldsTheErrorsOfLocatedTargets) { ExpectRadiusHolds(40); }
TEST(ReachedAccuracyNightly, TheRadiusHoldsTheErrorsOfLocatedTargets) { ExpectRadiusHolds(100); }

TEST(ReachedAccuracyTest, ConcernsTheCamerasThatSeeThePlace) {
  const CellScene scene = MixedCell(1);
  const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, AdjustmentOptions());
  ASSERT_TRUE(solution) << solution.reason();
  PlacedRequirement required;
  EXPECT_EQ(CamerasOf(ReachedBy(scene, *solution, required)), (std::vector<size_t>{0, 1, 2}));
  required.camera = "wrist";
  EXPECT_EQ(CamerasOf(ReachedBy(scene, *solution, required)), (std::vector<size_t>{2}));
  required.camera.clear();
  required.places_in_base_m = {kPlace};
  required.text = "a place";
  for (const CameraRequirement& entry : ReachedBy(scene, *solution, required)) {
    // The camera on the gripper can be moved anywhere.
    EXPECT_EQ(entry.requirement.place, entry.camera == 2 ? "the working point" : "a place");
    EXPECT_TRUE(entry.requirement.reached_m.has_value());
  }
  // A place that only one of the fixed cameras sees concerns that one.
  const Rigid3d& left = scene.truth.mount_from_camera[0];
  required.places_in_base_m = {left * Eigen::Vector3d(-0.2, 0, 0.45)};
  EXPECT_EQ(CamerasOf(ReachedBy(scene, *solution, required)), (std::vector<size_t>{0, 2}));
  // Each camera is judged at the corners of a box that it sees, if all are seen.
  required.places_in_base_m.push_back(kPlace);
  const std::vector<CameraRequirement> of_box = ReachedBy(scene, *solution, required);
  EXPECT_EQ(CamerasOf(of_box), (std::vector<size_t>{0, 1, 2}));
  for (const CameraRequirement& entry : of_box) EXPECT_TRUE(entry.requirement.reached_m.has_value());
  // A place that none of them sees is a failure of both.
  required.places_in_base_m.push_back({50, 0, 0});
  for (const CameraRequirement& entry : ReachedBy(scene, *solution, required)) {
    EXPECT_EQ(entry.requirement.reached_m.has_value(), entry.camera == 2);
  }
  required.places_in_base_m = {{50, 0, 0}};
  const std::vector<CameraRequirement> none = ReachedBy(scene, *solution, required);
  EXPECT_EQ(CamerasOf(none), (std::vector<size_t>{0, 1, 2}));
  for (const CameraRequirement& entry : none) EXPECT_EQ(entry.requirement.reached_m.has_value(), entry.camera == 2);
}

}  // namespace
}  // namespace heba
