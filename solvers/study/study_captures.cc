#include "solvers/study/study_captures.h"

#include <string>
#include <utility>

#include "heba/base/error.h"
#include "heba/data/prediction.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/study/study_places.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kOutlierPx = 40;
constexpr double kWrongM = 5e-3;
constexpr double kWrongRad = 0.02;

TargetShape TrueShape(const StudyCell& cell, size_t target) {
  TargetShape shape = cell.problem.targets[target].shape;
  shape.params = cell.shape_params;
  return shape;
}

// Returns the points of a target at their true positions.
Observations TruePoints(const StudyCell& cell, size_t target) {
  const Observations& designed = cell.targets[target].points;
  const bool is_designed = cell.shape_params == TargetShape().params;
  return is_designed ? designed : ApplyShape(designed, TrueShape(cell, target));
}

// Returns a pixel, displaced with the probability of the cell.
Eigen::Vector2d WithOutlier(Eigen::Vector2d pixel, const StudyCell& cell, Rng& rng) {
  if (rng.Uniform() >= cell.outlier_points) return pixel;
  pixel.x() += rng.Uniform(-kOutlierPx, kOutlierPx);
  pixel.y() += rng.Uniform(-kOutlierPx, kOutlierPx);
  return pixel;
}

// Returns the captures at one pose.
std::vector<View> ViewsAt(const StudyCell& cell, size_t index, const Eigen::VectorXd& drawn, Rng& rng) {
  const Setup setup = SetupOf(cell);
  const SimulatedPose& pose = cell.captures[index].seen;
  const Camera& camera = cell.problem.cameras[0].camera;
  const std::optional<StudyRobot>& robot = cell.robot;
  View view;
  view.name = "capture_" + std::to_string(index);
  view.role = pose.role;
  view.camera_mount_from_target_mount = CameraMountFromTargetMount(HandEyeOf(cell), pose.camera_from_target);
  view.observations = cell.targets[0].points;
  const bool estimates_arm = cell.options.bundle.effects != nullptr || !cell.options.choose.effects.empty();
  if (robot && estimates_arm) {
    view.effect = robot->effects[index];
    view.gripper_by_joints = robot->gripper_by_joints[index];
  }
  const Observations true_target = TruePoints(cell, 0);
  // The robot's error is drawn again if it puts the target behind the camera.
  constexpr int kMostDraws = 100;
  bool is_seen = false;
  for (int draw = 0; draw < kMostDraws && !is_seen; ++draw) {
    Tangent6 error;
    error << cell.robot_noise.translation_m * rng.NormalVector3(), cell.robot_noise.rotation_rad * rng.NormalVector3();
    Rigid3d correction = Retract(Rigid3d(), error);
    if (robot) {
      correction =
          DrawPoseError(*robot->effects[index], robot->gripper_by_joints[index], drawn, robot->joint_noise_rad, rng) *
          correction;
    }
    const Rigid3d camera_from_target =
        CameraFromTarget(setup, HandEyeOf(cell), view.camera_mount_from_target_mount, correction);
    is_seen = Predict(camera.Model(), camera.params.data(), camera_from_target, true_target, &view.observations.pixels,
                      nullptr);
  }
  if (!is_seen) throw InputError("the robot noise puts the target behind the camera in every draw");
  std::vector<View> views(static_cast<size_t>(cell.num_repeats), view);
  for (size_t repeat = 0; repeat < views.size(); ++repeat) {
    if (repeat > 0) views[repeat].name += "_" + std::to_string(repeat);
    auto& pixels = views[repeat].observations.pixels;
    for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
      const double u = cell.pixel_sigma_px * rng.Normal();
      const double v = cell.pixel_sigma_px * rng.Normal();
      pixels.col(i) = WithOutlier(pixels.col(i) + Eigen::Vector2d(u, v), cell, rng);
    }
  }
  if (rng.Uniform() < cell.wrong_captures) {
    const Rigid3d stated = BaseFromGripper(setup, view.camera_mount_from_target_mount);
    const Rigid3d wrong = CameraMountFromTargetMount(setup, WithRobotNoise(stated, kWrongRad, kWrongM, rng));
    for (View& repeated : views) repeated.camera_mount_from_target_mount = wrong;
  }
  return views;
}

// Returns the cell without any error of its captures.
StudyCell WithoutErrors(StudyCell cell) {
  cell.pixel_sigma_px = 0;
  cell.robot_noise = {};
  cell.outlier_points = 0;
  cell.wrong_captures = 0;
  if (cell.robot) cell.robot->joint_noise_rad = 0;
  return cell;
}

}  // namespace

std::vector<View> SimulateViews(const StudyCell& cell, const Eigen::VectorXd& drawn, Rng& rng) {
  std::vector<View> views;
  for (size_t i = 0; i < cell.captures.size(); ++i) {
    for (View& view : ViewsAt(cell, i, drawn, rng)) views.push_back(std::move(view));
  }
  return views;
}

Problem SimulateProblem(const StudyCell& cell, Rng& rng) {
  SceneOptions options;
  options.noise_px = cell.pixel_sigma_px;
  options.robot_noise = cell.robot_noise;
  options.motion.margin_px = cell.margin_px;
  std::vector<SimulatedTarget> targets;
  for (size_t t = 0; t < cell.targets.size(); ++t) {
    targets.push_back({TruePoints(cell, t).points_in_target, cell.targets[t].z_out});
  }
  const auto num_repeats = static_cast<size_t>(cell.num_repeats);
  std::vector<ArmPoses> arms;
  for (const StudyCapture& capture : cell.captures) arms.insert(arms.end(), num_repeats, capture.arms);
  Problem problem = cell.problem;
  problem.captures = SimulateCaptures(problem, cell.poses, targets, arms, options, rng);
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    ProblemCapture& capture = problem.captures[i];
    const bool is_wrong = cell.wrong_captures > 0 && i % num_repeats == 0 && rng.Uniform() < cell.wrong_captures;
    for (Rigid3d& pose : capture.base_from_gripper) {
      if (is_wrong) pose = WithRobotNoise(pose, kWrongRad, kWrongM, rng);
    }
    if (i % num_repeats > 0) capture.base_from_gripper = problem.captures[i - 1].base_from_gripper;
    for (ProblemImage& image : capture.images) {
      Observations& points = image.observations;
      points.points_in_target = cell.targets[image.target].points.points_in_target;
      for (Eigen::Index k = 0; k < points.size() && cell.outlier_points > 0; ++k) {
        points.pixels.col(k) = WithOutlier(points.pixels.col(k), cell, rng);
      }
    }
  }
  return problem;
}

Problem ExactProblem(const StudyCell& cell) {
  const StudyCell exact = WithoutErrors(cell);
  Rng rng(0);
  Problem problem;
  if (IsHandEye(cell)) {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(cell.robot ? cell.robot->errors->num_all : 0);
    PairProblem views{cell.problem.cameras[0].camera, SimulateViews(exact, none, rng), SetupOf(cell),
                      TrueShape(cell, 0)};
    for (size_t i = 0; i < views.views.size() && cell.robot; ++i) {
      const size_t pose = i / static_cast<size_t>(cell.num_repeats);
      views.views[i].effect = cell.robot->effects[pose];
      views.views[i].gripper_by_joints = cell.robot->gripper_by_joints[pose];
    }
    BundleOptions options;
    options.free_intrinsics = cell.problem.cameras[0].free_intrinsics;
    options.effects = DrawnErrors(cell);
    problem = HandEyeProblem(views, options);
  } else {
    problem = SimulateProblem(exact, rng);
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    problem.targets[t].shape = TrueShape(cell, t);
    problem.targets[t].free_shape = ShapeGroupsOf(cell);
  }
  return problem;
}

std::vector<TargetShapeGroup> ShapeGroupsOf(const StudyCell& cell) {
  std::vector<TargetShapeGroup> groups;
  for (size_t i = 0; i < cell.shape_params.size(); ++i) {
    const TargetShapeGroup group = ShapeGroupOf(static_cast<int>(i));
    const bool is_new = groups.empty() || groups.back() != group;
    if (is_new && cell.shape_params[i] != TargetShape().params[i]) groups.push_back(group);
  }
  return groups;
}

}  // namespace heba
