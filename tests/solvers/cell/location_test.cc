#include "heba/location.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"
#include "heba/refinement.h"
#include "tests/support/cell_scenes.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {

// A calibrated rig, and an object that its cameras see at one pose of the arm.
struct SeenObject {
  CellScene scene;
  Solution solution;
  Rigid3d world_from_target;
  std::vector<StatedPose> reported;
  std::vector<CameraObservations> seen;
};

// Returns camera_from_target of what a camera of the scene sees.
Rigid3d TrueView(const CellScene& scene, const ArmPoses& arms, size_t camera, const Rigid3d& world_from_target) {
  const Rigid3d world_from_camera =
      WorldFromMount(scene.problem.cameras[camera].mount, scene.truth.world_from_base, arms) *
      scene.truth.mount_from_camera[camera];
  return Inverse(world_from_camera) * world_from_target;
}

enum class Where { kBetweenFixedCameras, kBeforeTheWrist };
std::optional<SeenObject> SeeObject(uint64_t seed, double noise_px, Where where = Where::kBetweenFixedCameras) {
  CellSceneSetting setting;
  setting.num_captures = 30;
  setting.noise_px = noise_px;
  if (noise_px == 0) setting.robot_noise = {};
  SeenObject object;
  object.scene = MixedCell(seed, setting);
  CellScene& scene = object.scene;
  AdjustmentOptions options;
  if (noise_px == 0) options.robot = BundleOptions::Robot::kExact;
  Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, options);
  if (!solution) return std::nullopt;
  object.solution = std::move(*solution);
  // The object is where the plate is in a capture in which the camera on the wrist sees the wall: both fixed cameras
  // see it, or one of them.
  Rng rng(seed + 1);
  const ArmPoses& arms = scene.arms.front();
  object.world_from_target = LookingAt({0.55, 0.02, 0.42}, {0.55, -0.6, 0.1}, 0.3);
  if (where == Where::kBeforeTheWrist) {
    object.world_from_target =
        arms[0] * scene.truth.mount_from_camera[2] * Rigid3d(ExpRotation({0.3, -0.2, 0.5}), Eigen::Vector3d(0, 0, 0.6));
  }
  object.reported = {ReportedPose(arms[0], setting.robot_noise, rng)};
  const SimulatedTarget& target = scene.targets[0];
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    const Rigid3d camera_from_target = TrueView(scene, arms, c, object.world_from_target);
    if (!IsVisible(scene.problem.cameras[c].camera, camera_from_target, target, 5)) continue;
    object.seen.push_back({c, SimulateView("", scene.problem.cameras[c].camera, {}, camera_from_target,
                                           target.points_in_target, noise_px, rng)
                                  ->observations});
  }
  return object;
}

TEST(CellLocation, FindsTheExactPoseWithoutNoise) {
  const std::optional<SeenObject> object = SeeObject(1, 0);
  ASSERT_TRUE(object.has_value());
  ASSERT_GE(object->seen.size(), 2U);
  const Outcome<LocatedTarget> located =
      LocateInCell(object->scene.problem, object->solution, object->seen, object->reported);
  ASSERT_TRUE(located) << located.reason();
  EXPECT_THAT(located->world_from_target, IsNearPose(object->world_from_target, 1e-7, 1e-7));
  EXPECT_LT(located->rms_px, 1e-4);
}

// Adds the error of an image as a whole: it acts like another pose of the target, and has the sigma `sigma_px` in the
// mean over all coordinates of the points.
void AddImageError(const Camera& camera, const Rigid3d& camera_from_target, double sigma_px, Rng& rng,
                   Observations* observations) {
  Points2 pixels;
  ProjectionJacobian jacobian;
  ASSERT_TRUE(Predict(camera.Model(), camera.params.data(), camera_from_target, *observations, &pixels, &jacobian));
  const Eigen::Index num_points = observations->size();
  Eigen::MatrixXd by_pose(2 * num_points, 6);
  for (Eigen::Index i = 0; i < num_points; ++i) {
    by_pose.row(2 * i) = jacobian.u.col(i).head<6>().transpose();
    by_pose.row(2 * i + 1) = jacobian.v.col(i).head<6>().transpose();
  }
  Tangent6 error;
  for (Eigen::Index k = 0; k < 6; ++k) error[k] = rng.Normal();
  error *= sigma_px * std::sqrt(2.0 * static_cast<double>(num_points) / 6);
  const Eigen::VectorXd moved = HouseholderFactor(by_pose).Basis() * error;
  for (Eigen::Index i = 0; i < num_points; ++i) observations->pixels.col(i) += moved.segment<2>(2 * i);
}

// The mean of the chi-squares with 6 degrees of freedom is within 4 standard deviations of 6, and that of a
// point, with 3 degrees of freedom, within 4 of 3. The chances of the cameras' differences are uniform: their mean is
// within 4 standard deviations of 0.5.
void ExpectHonestErrors(int num_trials) {
  double pose_sum = 0;
  double point_sum = 0;
  double chance_sum = 0;
  int num_seen = 0;
  for (uint64_t seed = 1; seed <= static_cast<uint64_t>(num_trials); ++seed) {
    const std::optional<SeenObject> object = SeeObject(seed, 0.1);
    ASSERT_TRUE(object.has_value());
    if (object->seen.size() < 2) continue;
    ++num_seen;
    const Outcome<LocatedTarget> located =
        LocateInCell(object->scene.problem, object->solution, object->seen, object->reported);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object->world_from_target);
    pose_sum += MahalanobisSquare(error, located->pose_covariance.Total());
    chance_sum += located->p_value;
    std::vector<CameraPixel> pixels;
    for (const CameraObservations& view : object->seen) {
      pixels.push_back({view.camera, view.observations.pixels.col(5)});
    }
    const Outcome<LocatedPoint> point =
        TriangulateInCell(object->scene.problem, object->solution, pixels, object->reported);
    ASSERT_TRUE(point) << point.reason();
    const Eigen::Vector3d true_point =
        object->world_from_target * Eigen::Vector3d(object->scene.targets[0].points_in_target.col(5));
    const Eigen::Vector3d off = point->in_world - true_point;
    point_sum += MahalanobisSquare(off, point->covariance.TotalM2());
  }
  ASSERT_GE(3 * num_seen, 2 * num_trials);
  EXPECT_NEAR(pose_sum / num_seen, 6, 4 * std::sqrt(12.0 / num_seen));
  EXPECT_NEAR(point_sum / num_seen, 3, 4 * std::sqrt(6.0 / num_seen));
  EXPECT_NEAR(chance_sum / num_seen, 0.5, 4 * std::sqrt(1.0 / 12 / num_seen));
}

TEST(CellLocation, ErrorsAgreeWithTheCovariance) { ExpectHonestErrors(20); }
TEST(CellLocationNightly, ErrorsAgreeWithTheCovariance) { ExpectHonestErrors(60); }

// Likewise with an error of each image as a whole, which is much larger than that of its points. The calibration is
// exact, so that the errors are those of the images alone. A point takes part in the error of its image like the mean
// of all points; the variances of the single points differ, which widens the distribution of their chi-squares by less
// than half.
void ExpectHonestErrorsOfImages(int num_trials) {
  const std::optional<SeenObject> object = SeeObject(1, 0);
  ASSERT_TRUE(object.has_value());
  ASSERT_GE(object->seen.size(), 2U);
  constexpr double kImagePx = 0.5;
  constexpr double kPixelPx = 0.05;
  Solution solution = object->solution;
  solution.pixel_sigmas_px.assign(solution.pixel_sigmas_px.size(), kPixelPx);
  solution.image_sigmas_px.assign(solution.image_sigmas_px.size(), kImagePx);
  Rng rng(7);
  double pose_sum = 0;
  double point_sum = 0;
  double on_plane_sum = 0;
  double chance_sum = 0;
  const Eigen::Matrix3d rotation = object->world_from_target.RotationMatrix();
  const Plane plane{rotation.col(2), rotation.col(2).dot(object->world_from_target.translation)};
  for (int trial = 0; trial < num_trials; ++trial) {
    std::vector<CameraObservations> seen = object->seen;
    const Eigen::Index id = rng.Index(seen.front().observations.size());
    std::vector<CameraPixel> pixels;
    for (CameraObservations& view : seen) {
      AddImageError(object->scene.problem.cameras[view.camera].camera,
                    TrueView(object->scene, object->scene.arms.front(), view.camera, object->world_from_target),
                    kImagePx, rng, &view.observations);
      for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
        view.observations.pixels.col(i) += kPixelPx * Eigen::Vector2d{rng.Normal(), rng.Normal()};
      }
      pixels.push_back({view.camera, view.observations.pixels.col(id)});
    }
    const Outcome<LocatedTarget> located = LocateInCell(object->scene.problem, solution, seen, object->reported);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object->world_from_target);
    pose_sum += MahalanobisSquare(error, located->pose_covariance.Total());
    chance_sum += located->p_value;
    const Outcome<LocatedPoint> point = TriangulateInCell(object->scene.problem, solution, pixels, object->reported);
    ASSERT_TRUE(point) << point.reason();
    const Eigen::Vector3d true_point =
        object->world_from_target * Eigen::Vector3d(object->scene.targets[0].points_in_target.col(id));
    const Eigen::Vector3d off = point->in_world - true_point;
    point_sum += MahalanobisSquare(off, point->covariance.TotalM2());
    const Outcome<LocatedPoint> on_plane =
        LocatePixelInCell(object->scene.problem, solution, pixels.front(), plane, object->reported);
    ASSERT_TRUE(on_plane) << on_plane.reason();
    const Eigen::Matrix<double, 3, 2> along = rotation.leftCols<2>();
    on_plane_sum += MahalanobisSquare(Eigen::Vector2d(along.transpose() * (on_plane->in_world - true_point)),
                                      Eigen::Matrix2d(along.transpose() * on_plane->covariance.TotalM2() * along));
  }
  EXPECT_NEAR(pose_sum / num_trials, 6, 4 * std::sqrt(12.0 / num_trials));
  EXPECT_NEAR(point_sum / num_trials, 3, 4 * 1.5 * std::sqrt(6.0 / num_trials));
  EXPECT_NEAR(on_plane_sum / num_trials, 2, 4 * 1.5 * std::sqrt(4.0 / num_trials));
  EXPECT_NEAR(chance_sum / num_trials, 0.5, 4 * std::sqrt(1.0 / 12 / num_trials));
}

TEST(CellLocation, ErrorsOfImagesAsAWholeAgreeWithTheCovariance) { ExpectHonestErrorsOfImages(100); }
TEST(CellLocationNightly, ErrorsOfImagesAsAWholeAgreeWithTheCovariance) { ExpectHonestErrorsOfImages(400); }

// What the cameras of a rig see of its first target in the first capture in which at least `num_cameras` see it.
struct SeenCapture {
  ProblemCapture capture;
  std::vector<CameraObservations> seen;
};
SeenCapture SeeFirstTarget(const Problem& problem, size_t num_cameras, size_t first = 0) {
  for (size_t i = first; i < problem.captures.size(); ++i) {
    SeenCapture found{problem.captures[i], {}};
    for (const ProblemImage& image : found.capture.images) {
      if (image.target == 0) found.seen.push_back({image.camera, image.observations});
    }
    if (found.seen.size() >= num_cameras) return found;
  }
  return {};
}

// The image of one of four cameras is that of another capture: it is named, and the others agree.
TEST(CellLocation, NamesTheCameraThatContradictsTheOthers) {
  CellScene scene = FourCameraCell(4);
  const Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, {});
  ASSERT_TRUE(solution) << solution.reason();
  SeenCapture right = SeeFirstTarget(scene.problem, 3);
  ASSERT_GE(right.seen.size(), 3U);
  const std::vector<Rigid3d>& reported = right.capture.base_from_gripper;
  const std::vector<StatedPose> poses(reported.begin(), reported.end());
  EXPECT_FALSE(FindContradiction(scene.problem, *solution, 0, right.seen, poses).has_value());
  for (size_t wrong = 0; wrong < right.seen.size(); ++wrong) {
    std::vector<CameraObservations> seen = right.seen;
    const auto has_other = [&](const ProblemCapture& capture) {
      return std::any_of(capture.images.begin(), capture.images.end(), [&](const ProblemImage& image) {
        const bool is_other = capture.name != right.capture.name && image.camera == seen[wrong].camera;
        if (is_other) seen[wrong].observations = image.observations;
        return is_other;
      });
    };
    ASSERT_TRUE(std::any_of(scene.problem.captures.begin(), scene.problem.captures.end(), has_other));
    const auto contradiction = FindContradiction(scene.problem, *solution, 0, seen, poses);
    ASSERT_TRUE(contradiction.has_value()) << wrong;
    EXPECT_EQ(contradiction->camera, seen[wrong].camera);
    // The difference is the motion of the target between the two captures.
    ASSERT_TRUE(contradiction->difference.has_value());
    const Outcome<LocatedTarget> by_others =
        LocateInCell(scene.problem, *solution, {right.seen[(wrong + 1) % right.seen.size()]}, poses);
    const Outcome<LocatedTarget> by_wrong = LocateInCell(scene.problem, *solution, {seen[wrong]}, poses);
    ASSERT_TRUE(by_others && by_wrong);
    EXPECT_THAT(*contradiction->difference,
                IsNearPose(Inverse(by_others->world_from_target) * by_wrong->world_from_target, 2e-3, 2e-3));
    // Of two cameras it cannot be told which one is wrong.
    const auto of_two = FindContradiction(scene.problem, *solution, 0,
                                          {right.seen[(wrong + 1) % right.seen.size()], seen[wrong]}, poses);
    ASSERT_TRUE(of_two.has_value());
    EXPECT_FALSE(of_two->camera.has_value());
    EXPECT_TRUE(of_two->difference.has_value());
  }
}

// Cameras that read a target with a symmetry in different orders see the same poses of it.
TEST(CellLocation, ReadsSymmetricTargetsOfAllCamerasInOneOrder) {
  CellScene scene = FourCameraCell(5, {.noise_px = 0, .robot_noise = {}});
  AdjustmentOptions options;
  options.robot = BundleOptions::Robot::kExact;
  Outcome<Solution> solution = RefineProblem(scene.problem, scene.truth, options);
  ASSERT_TRUE(solution) << solution.reason();
  const Rigid3d turned(ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero());
  scene.problem.targets[0].symmetries = {Rigid3d(), turned};
  const SeenCapture right = SeeFirstTarget(scene.problem, 3);
  ASSERT_GE(right.seen.size(), 3U);
  const Rigid3d truth = scene.arms[0][0] * scene.truth.mount_from_target[0];
  const std::vector<Rigid3d>& reported = right.capture.base_from_gripper;
  const std::vector<StatedPose> poses(reported.begin(), reported.end());
  ASSERT_EQ(right.capture.name, scene.problem.captures[0].name);
  for (unsigned orders = 0; orders < (1U << right.seen.size()); ++orders) {
    std::vector<CameraObservations> seen = right.seen;
    for (size_t v = 0; v < seen.size(); ++v) {
      if ((orders >> v & 1U) == 0) continue;
      Points3& points = seen[v].observations.points_in_target;
      points = (turned.RotationMatrix() * points).eval();
    }
    const auto possible = LocateTargetInCell(scene.problem, *solution, 0, seen, poses);
    ASSERT_TRUE(possible) << possible.reason();
    ASSERT_EQ(possible->size(), 2U);
    const auto along_x = [](const LocatedTarget& located) { return located.world_from_target.RotationMatrix()(0, 0); };
    EXPECT_GT(along_x((*possible)[0]), along_x((*possible)[1]));
    const bool is_first = (truth.rotation * Eigen::Vector3d::UnitX()).x() > 0;
    EXPECT_THAT((*possible)[is_first ? 0 : 1].world_from_target, IsNearPose(truth, 1e-6, 1e-6)) << orders;
    EXPECT_THAT((*possible)[is_first ? 1 : 0].world_from_target, IsNearPose(truth * turned, 1e-6, 1e-6)) << orders;
    for (const LocatedTarget& located : *possible) EXPECT_LT(located.rms_px, 1e-3);
    EXPECT_FALSE(FindContradiction(scene.problem, *solution, 0, seen, poses).has_value());
  }
}

// Likewise for the camera on the wrist, whose arm is noisy: the error of the arm's pose is part of the covariance. So
// it is with a pixel on the plane of the target, which is given or seen, and with the gripper when it is sent to the
// target.
void ExpectHonestErrorsOfACarriedCamera(int num_trials) {
  double pose_sum = 0;
  double on_plane_sum = 0;
  double on_target_sum = 0;
  double reach_sum = 0;
  double robot_m2 = 0;
  double image_m2 = 0;
  for (uint64_t seed = 101; seed < 101 + static_cast<uint64_t>(num_trials); ++seed) {
    const std::optional<SeenObject> object = SeeObject(seed, 0.1, Where::kBeforeTheWrist);
    ASSERT_TRUE(object.has_value());
    const Outcome<LocatedTarget> located =
        LocateInCell(object->scene.problem, object->solution, object->seen, object->reported);
    ASSERT_TRUE(located) << located.reason();
    const Tangent6 error = LocalCoordinates(located->world_from_target, object->world_from_target);
    pose_sum += MahalanobisSquare(error, located->pose_covariance.Total());
    robot_m2 += located->pose_covariance.by_robot.topLeftCorner<3, 3>().trace();
    image_m2 += located->pose_covariance.by_image.topLeftCorner<3, 3>().trace();

    const Problem& rig = object->scene.problem;
    const Rigid3d& truth = object->world_from_target;
    const CameraObservations& view = object->seen.front();
    const CameraPixel pixel{view.camera, view.observations.pixels.col(5)};
    const Eigen::Vector3d true_point = truth * Eigen::Vector3d(view.observations.points_in_target.col(5));
    const Eigen::Vector3d normal = truth.rotation * Eigen::Vector3d::UnitZ();
    const Plane plane{normal, normal.dot(truth.translation)};
    const Outcome<LocatedPoint> on_plane = LocatePixelInCell(rig, object->solution, pixel, plane, object->reported);
    ASSERT_TRUE(on_plane) << on_plane.reason();
    const Eigen::Matrix<double, 3, 2> along = truth.RotationMatrix().leftCols<2>();
    on_plane_sum += MahalanobisSquare(Eigen::Vector2d(along.transpose() * (on_plane->in_world - true_point)),
                                      Eigen::Matrix2d(along.transpose() * on_plane->covariance.TotalM2() * along));
    const Outcome<LocatedPoint> on_target =
        LocatePixelOnTargetInCell(rig, object->solution, pixel, *located, object->reported);
    ASSERT_TRUE(on_target) << on_target.reason();
    on_target_sum +=
        MahalanobisSquare(Eigen::Vector3d(on_target->in_world - true_point), on_target->covariance.TotalM2());
    // The gripper is sent to where it was in another capture.
    Rng rng(seed + 1000);
    const Rigid3d there = object->scene.arms[1][0];
    const StatedPose command(ReportedPose(there, CellSceneSetting().robot_noise, rng));
    const Eigen::Vector3d off_m = command.base_from_mount.translation - there.translation -
                                  (located->world_from_target.translation - truth.translation);
    reach_sum +=
        MahalanobisSquare(off_m, CovarianceOfReachInCell(rig, object->solution, 0, *located, command).TotalM2());
  }
  EXPECT_NEAR(pose_sum / num_trials, 6, 4 * std::sqrt(12.0 / num_trials));
  EXPECT_NEAR(on_plane_sum / num_trials, 2, 4 * std::sqrt(4.0 / num_trials));
  EXPECT_NEAR(on_target_sum / num_trials, 3, 4 * std::sqrt(6.0 / num_trials));
  EXPECT_NEAR(reach_sum / num_trials, 3, 4 * std::sqrt(6.0 / num_trials));
  EXPECT_GT(robot_m2, image_m2);
}

TEST(CellLocation, ErrorsOfACarriedCameraAgreeWithTheCovariance) { ExpectHonestErrorsOfACarriedCamera(20); }
TEST(CellLocationNightly, ErrorsOfACarriedCameraAgreeWithTheCovariance) { ExpectHonestErrorsOfACarriedCamera(60); }

TEST(CellLocation, SeveralCamerasAreBetterThanOne) {
  const std::optional<SeenObject> object = SeeObject(2, 0.1);
  ASSERT_TRUE(object.has_value());
  ASSERT_GE(object->seen.size(), 2U);
  const Outcome<LocatedTarget> all =
      LocateInCell(object->scene.problem, object->solution, object->seen, object->reported);
  ASSERT_TRUE(all);
  for (const CameraObservations& view : object->seen) {
    const Outcome<LocatedTarget> one = LocateInCell(object->scene.problem, object->solution, {view}, object->reported);
    ASSERT_TRUE(one);
    EXPECT_LT((all->pose_covariance.by_image.topLeftCorner<3, 3>().trace()),
              (one->pose_covariance.by_image.topLeftCorner<3, 3>().trace()));
  }
}

TEST(CellLocation, ParallelRaysAreRefused) {
  const std::optional<SeenObject> object = SeeObject(3, 0);
  ASSERT_TRUE(object.has_value());
  const CameraPixel pixel{0, {800, 600}};
  EXPECT_FALSE(TriangulateInCell(object->scene.problem, object->solution, {pixel}, object->reported));
  EXPECT_FALSE(TriangulateInCell(object->scene.problem, object->solution, {pixel, pixel}, object->reported));
}

}  // namespace
}  // namespace heba
