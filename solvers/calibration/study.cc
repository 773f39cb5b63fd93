#include "solvers/calibration/study.h"

#include <algorithm>
#include <cmath>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/median.h"
#include "heba/base/rng.h"
#include "heba/calibration.h"
#include "heba/data/prediction.h"
#include "solvers/calibration/study_places.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kOutlierPx = 40;
constexpr double kWrongM = 5e-3;
constexpr double kWrongRad = 0.02;

// Returns whether the refinement may estimate systematic errors of the robot.
bool EstimatesArm(const StudyCell& cell) {
  return cell.options.bundle.effects != nullptr || !cell.options.choose.effects.empty();
}

// Returns the captures at one pose.
std::vector<View> MakeViews(const StudyCell& cell, size_t index, const Eigen::VectorXd& drawn, Rng* rng) {
  const heba::Setup setup = cell.options.setup;
  const SimulatedPose& pose = cell.poses[index];
  View view;
  view.name = "capture_" + std::to_string(index);
  view.role = pose.role;
  view.camera_mount_from_target_mount = CameraMountFromTargetMount(cell.hand_eye, pose.camera_from_target);
  view.observations = cell.target;
  if (cell.robot && EstimatesArm(cell)) {
    view.effect = cell.robot->effects[index];
    view.gripper_by_joints = cell.robot->gripper_by_joints[index];
  }
  const bool is_designed = cell.shape.params == TargetShape().params;
  const Observations true_target = is_designed ? cell.target : ApplyShape(cell.target, cell.shape);
  // The robot's error is drawn again if it puts the target behind the camera.
  constexpr int kMostDraws = 100;
  bool is_seen = false;
  for (int draw = 0; draw < kMostDraws && !is_seen; ++draw) {
    Tangent6 error;
    error << cell.robot_noise.translation_m * rng->NormalVector3(),
        cell.robot_noise.rotation_rad * rng->NormalVector3();
    Rigid3d correction = Retract(Rigid3d(), error);
    if (cell.robot) {
      correction = DrawPoseError(*cell.robot->effects[index], cell.robot->gripper_by_joints[index], drawn,
                                 cell.robot->joint_noise_rad, rng) *
                   correction;
    }
    const Rigid3d camera_from_target =
        CameraFromTarget(setup, cell.hand_eye, view.camera_mount_from_target_mount, correction);
    is_seen = Predict(cell.camera.Model(), cell.camera.params.data(), camera_from_target, true_target,
                      &view.observations.pixels, nullptr);
  }
  if (!is_seen) throw InputError("the robot noise puts the target behind the camera in every draw");
  std::vector<View> views(static_cast<size_t>(cell.num_repeats), view);
  for (size_t repeat = 0; repeat < views.size(); ++repeat) {
    if (repeat > 0) views[repeat].name += "_" + std::to_string(repeat);
    auto& pixels = views[repeat].observations.pixels;
    for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
      const double u = cell.pixel_sigma_px * rng->Normal();
      const double v = cell.pixel_sigma_px * rng->Normal();
      pixels.col(i) += Eigen::Vector2d(u, v);
      if (rng->Uniform() < cell.outlier_points) {
        pixels(0, i) += rng->Uniform(-kOutlierPx, kOutlierPx);
        pixels(1, i) += rng->Uniform(-kOutlierPx, kOutlierPx);
      }
    }
  }
  if (rng->Uniform() < cell.wrong_captures) {
    const Rigid3d stated = BaseFromGripper(setup, view.camera_mount_from_target_mount);
    const Rigid3d wrong = CameraMountFromTargetMount(setup, WithRobotNoise(stated, kWrongRad, kWrongM, rng));
    for (View& repeated : views) repeated.camera_mount_from_target_mount = wrong;
  }
  return views;
}

// Returns the views at all poses, those of each pose in a row.
std::vector<View> MakeAllViews(const StudyCell& cell, const Eigen::VectorXd& drawn, Rng* rng) {
  std::vector<View> views;
  for (size_t i = 0; i < cell.poses.size(); ++i) {
    for (View& view : MakeViews(cell, i, drawn, rng)) views.push_back(std::move(view));
  }
  return views;
}

// Returns which parameters of the camera are free.
FreeParameters FreeOf(const StudyCell& cell) {
  return FreeOf(cell.camera.Model(), cell.options.bundle.free_intrinsics);
}

// Returns the parts of the target's shape that differ from the design.
std::vector<TargetShapeGroup> ShapeGroupsOf(const StudyCell& cell) {
  std::vector<TargetShapeGroup> groups;
  for (const TargetShapeGroup group : {TargetShapeGroup::kScale, TargetShapeGroup::kBend}) {
    bool differs = false;
    for (int i = 0; i < TargetShape::kNumParams; ++i) {
      const auto k = static_cast<size_t>(i);
      differs = differs || (ShapeGroupOf(i) == group && cell.shape.params[k] != TargetShape().params[k]);
    }
    if (differs) groups.push_back(group);
  }
  return groups;
}

bool IsModelOf(const StudyCell& cell, const BundleOptions& bundle) {
  if (bundle.free_shape != ShapeGroupsOf(cell)) return false;
  const bool has_errors = DrawnErrors(cell) != nullptr;
  if (has_errors != (bundle.effects != nullptr)) return false;
  const bool has_joint_noise = cell.robot && cell.robot->joint_noise_rad > 0;
  const bool is_noisy = cell.robot_noise.translation_m > 0 || cell.robot_noise.rotation_rad > 0 || has_joint_noise;
  // Systematic errors are modelled beside noise, which may be zero.
  return has_errors || (bundle.robot != BundleOptions::Robot::kExact) == is_noisy;
}

// Returns the errors of the unknowns in a layout of this cell, whose robot has the systematic errors `drawn`.
Eigen::VectorXd ErrorOf(const StudyCell& cell, const UnknownLayout& layout, const Solution& solution,
                        const Eigen::VectorXd& drawn = {}) {
  const Tangent6 hand_eye =
      LocalCoordinates(cell.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
  const Tangent6 board =
      LocalCoordinates(cell.hand_eye.target_mount_from_target, solution.hand_eye.target_mount_from_target);
  Eigen::VectorXd error = Eigen::VectorXd::Zero(layout.size());
  for (const UnknownBlock& block : layout.blocks()) {
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const auto k = static_cast<size_t>(layout[i].index);
      if (block.owner == UnknownOwner::kCamera) error[i] = solution.camera.params[k] - cell.camera.params[k];
      if (block.owner == UnknownOwner::kEffects) {
        const auto effect = static_cast<size_t>(i - block.first);
        error[i] = solution.effects[i - block.first] - drawn[solution.shared_effects->effects[effect].index];
      }
      if (block.owner == UnknownOwner::kTarget) error[i] = solution.shape.params[k] - cell.shape.params[k];
      if (block.owner == UnknownOwner::kPose)
        error[i] = block.name == kHandEyeBlock ? hand_eye[i - block.first] : board[i - block.first];
    }
  }
  return error;
}

TrialEstimate FailedEstimate(const std::string& method) {
  TrialEstimate estimate;
  estimate.method = method;
  return estimate;
}

TrialEstimate EstimateOf(const StudyCell& cell, const std::string& method, const Outcome<HandEye>& hand_eye,
                         const std::vector<PosePair>& pairs) {
  TrialEstimate estimate;
  estimate.method = method;
  estimate.ok = hand_eye.ok();
  if (!hand_eye) return estimate;
  Solution poses;
  poses.hand_eye = *hand_eye;
  estimate.error = ErrorOf(cell, HandEyePoses(), poses);
  estimate.axxb_mean_mm = AxxbMeanMm(pairs, hand_eye->camera_mount_from_camera).value_or(0);
  return estimate;
}

// Returns the numbers of all unknowns but the robot's systematic errors and the target's shape.
Eigen::VectorXd WithoutEffects(const UnknownLayout& layout, const Eigen::VectorXd& numbers) {
  const UnknownBlock robot = layout.Block(kRobotBlock);
  const Eigen::Index end = layout.Block(kTargetBlock).first;
  if (robot.size == 0) return numbers.head(end);
  Eigen::VectorXd others(end - robot.size);
  others << numbers.head(robot.first), numbers.segment(robot.end(), end - robot.end());
  return others;
}

TrialEstimate EstimateOf(const StudyCell& cell, const std::string& method, const Outcome<Solution>& solution,
                         const std::vector<PosePair>& pairs, const Eigen::VectorXd& drawn) {
  if (!solution) return FailedEstimate(method);
  TrialEstimate estimate = EstimateOf(cell, method, Outcome<HandEye>(solution->hand_eye), pairs);
  const Eigen::MatrixXd& covariance = solution->covariance.matrix;
  const double dof = static_cast<double>(covariance.rows());
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  // The chain does not estimate intrinsics.
  const Eigen::VectorXd error = ErrorOf(cell, solution->covariance.layout, *solution, drawn);
  estimate.error = WithoutEffects(solution->covariance.layout, error);
  if (cell.robot && method == kBundleMethod) estimate.has_effects = solution->shared_effects != nullptr;
  const Eigen::VectorXd scaled_error = scale.cwiseProduct(error);
  const double squares = MahalanobisSquare(scaled_error, scale.asDiagonal() * covariance * scale.asDiagonal());
  constexpr double kOutside = 0.05;
  estimate.is_covered = squares <= dof * FisherQuantile(kOutside, dof, solution->covariance_dof);
  estimate.pixel_sigma_px = solution->pixel_sigma_px;
  estimate.robot_noise = solution->robot_noise;
  return estimate;
}

// Computes RMS errors from the mean squared error of each unknown.
StudyErrors FromMeanSquares(const StudyCell& cell, const Eigen::VectorXd& squares) {
  const FreeParameters free = FreeOf(cell);
  const UnknownLayout layout = HandEyeUnknowns(cell.camera.Model(), free);
  const auto length_of = [&](std::string_view pose, Eigen::Index at) {
    return std::sqrt(squares.segment<3>(layout.Block(pose).first + at).sum());
  };
  StudyErrors errors;
  errors.hand_eye_m = length_of(kHandEyeBlock, 0);
  errors.hand_eye_rad = length_of(kHandEyeBlock, 3);
  errors.board_m = length_of(kBoardBlock, 0);
  errors.board_rad = length_of(kBoardBlock, 3);
  const Eigen::Index focal = layout.Block(kCameraBlock).first;
  if (free[0] && free[1] && squares.size() >= focal + 2) {
    errors.focal_px = std::sqrt(0.5 * squares.segment<2>(focal).sum());
  }
  return errors;
}

}  // namespace

std::vector<TrialEstimate> RunTrial(const StudyCell& cell, uint64_t seed, int trial) {
  Rng rng(seed, static_cast<uint64_t>(trial));
  const Eigen::VectorXd drawn = DrawErrors(cell, &rng);
  const Outcome<Calibration> calibration = Calibrate(MakeAllViews(cell, drawn, &rng), cell.options);
  std::vector<TrialEstimate> estimates;
  if (!calibration) {
    for (const std::string& name : cell.options.methods) estimates.push_back(FailedEstimate(name));
    for (const char* name : {kChainMethod, kBundleMethod}) estimates.push_back(FailedEstimate(name));
    return estimates;
  }
  for (const MethodResult& method : calibration->methods) {
    // A method for another type of motion is left out of the study unless it was requested.
    const bool suits = FindHandEyeMethod(method.method)->motion == MethodMotion::kAny || method.hand_eye.ok();
    if (!suits && cell.options.methods.empty()) continue;
    estimates.push_back(EstimateOf(cell, method.method, method.hand_eye, calibration->pairs));
  }
  estimates.push_back(EstimateOf(cell, kChainMethod, calibration->chain, calibration->pairs, drawn));
  estimates.push_back(EstimateOf(cell, kBundleMethod, calibration->refined, calibration->pairs, drawn));
  if (calibration->refined && cell.robot) {
    AddPlaceErrors(cell, *calibration->refined, drawn, &rng, &estimates.back());
  }
  if (calibration->refined && !calibration->alternatives.empty()) {
    estimates.back().has_right_model = IsModelOf(cell, calibration->bundle);
  }
  return estimates;
}

Outcome<StudyErrors> ErrorBound(const StudyCell& cell) {
  StudyCell exact = cell;
  exact.pixel_sigma_px = 0;
  exact.robot_noise = {};
  exact.outlier_points = 0;
  exact.wrong_captures = 0;
  Eigen::VectorXd no_errors;
  if (exact.robot) {
    exact.robot->joint_noise_rad = 0;
    no_errors = Eigen::VectorXd::Zero(exact.robot->errors->num_all);
  }
  Problem problem{cell.camera, {}, cell.options.setup, cell.shape};
  Rng rng(0);
  problem.views = MakeAllViews(exact, no_errors, &rng);
  for (size_t i = 0; i < problem.views.size() && cell.robot; ++i) {
    const size_t pose = i / static_cast<size_t>(cell.num_repeats);
    problem.views[i].effect = cell.robot->effects[pose];
    problem.views[i].gripper_by_joints = cell.robot->gripper_by_joints[pose];
  }
  const std::shared_ptr<const SharedEffects> drawn = DrawnErrors(cell);
  BundleOptions free;
  free.free_intrinsics = cell.options.bundle.free_intrinsics;
  free.free_shape = ShapeGroupsOf(cell);
  free.effects = drawn;
  const RigProblem whole = HandEyeProblem(problem, free);
  Fit fit;
  fit.problem = Borrowed(whole);
  fit.groups = GroupByRobotPoses(whole);
  fit.state = {HandEyePosesOf(cell.hand_eye), {cell.camera}, {cell.shape}, {}, {}};
  fit.noise = {{cell.pixel_sigma_px}, {0}, {}};
  RobotNoise noise = cell.robot_noise;
  if (cell.robot) noise.joint_rad = cell.robot->joint_noise_rad;
  const bool is_exact = noise.translation_m == 0 && noise.rotation_rad == 0 && noise.joint_rad == 0;
  if (!is_exact) fit.noise.robots = {AtLeastExact(noise)};
  AddEffects(whole, &fit.state, &fit.noise);
  const std::optional<Information> found = FitInformation(fit, LossOf(LossKind::kNone), 1);
  CHECK(found.has_value());
  const Information& information = *found;
  if (const std::optional<Failure> failure = CheckObservable(information)) return *failure;
  const Covariance covariance = InvertInformation(information, 1.0);
  StudyErrors bound = FromMeanSquares(cell, WithoutEffects(covariance.layout, covariance.matrix.diagonal()));
  if (cell.robot) AddPlaceBounds(cell, drawn.get(), covariance, &bound);
  return bound;
}

std::vector<MethodSummary> Summarise(const StudyCell& cell, const std::vector<std::vector<TrialEstimate>>& trials) {
  return SummariseTrials(trials, [&](const Eigen::VectorXd& squares) { return FromMeanSquares(cell, squares); });
}

std::vector<MethodSummary> SummariseTrials(const std::vector<std::vector<TrialEstimate>>& trials,
                                           const std::function<StudyErrors(const Eigen::VectorXd&)>& errors_of) {
  CHECK(!trials.empty());
  std::vector<MethodSummary> summaries;
  for (const TrialEstimate& first : trials.front()) {
    MethodSummary summary;
    summary.method = first.method;
    Eigen::VectorXd squares;
    int num_covered = 0;
    int num_with_covariance = 0;
    int num_right = 0;
    int num_chosen = 0;
    int num_tried_effects = 0;
    int num_with_effects = 0;
    PlaceErrors inside;
    PlaceErrors outside;
    std::vector<double> pixel_sigmas;
    std::vector<double> translations;
    std::vector<double> rotations;
    for (const std::vector<TrialEstimate>& trial : trials) {
      const auto estimate = std::find_if(trial.begin(), trial.end(),
                                         [&](const TrialEstimate& entry) { return entry.method == first.method; });
      ++summary.num_trials;
      if (estimate == trial.end() || !estimate->ok) {
        ++summary.num_failed;
        continue;
      }
      if (squares.size() == 0) squares = Eigen::VectorXd::Zero(estimate->error.size());
      squares += estimate->error.cwiseAbs2();
      summary.axxb_mean_mm += estimate->axxb_mean_mm;
      if (estimate->is_covered) {
        ++num_with_covariance;
        num_covered += *estimate->is_covered ? 1 : 0;
      }
      if (estimate->has_right_model) {
        ++num_chosen;
        num_right += *estimate->has_right_model ? 1 : 0;
      }
      if (estimate->has_effects) {
        ++num_tried_effects;
        num_with_effects += *estimate->has_effects ? 1 : 0;
      }
      AddTo(estimate->inside, &inside);
      AddTo(estimate->outside, &outside);
      if (estimate->pixel_sigma_px) pixel_sigmas.push_back(*estimate->pixel_sigma_px);
      if (estimate->robot_noise) {
        translations.push_back(estimate->robot_noise->translation_m);
        rotations.push_back(estimate->robot_noise->rotation_rad);
      }
    }
    const int num_good = summary.num_trials - summary.num_failed;
    if (num_good > 0) {
      summary.rms = errors_of(squares / num_good);
      summary.axxb_mean_mm /= num_good;
    }
    if (num_with_covariance > 0) summary.coverage = static_cast<double>(num_covered) / num_with_covariance;
    if (num_tried_effects > 0) summary.estimated_effects = static_cast<double>(num_with_effects) / num_tried_effects;
    if (inside.num > 0) {
      summary.rms.inside_m = std::sqrt(inside.sum_m2 / inside.num);
      summary.coverage_inside = static_cast<double>(inside.num_covered) / inside.num;
    }
    if (outside.num > 0) {
      summary.rms.outside_m = std::sqrt(outside.sum_m2 / outside.num);
      summary.coverage_outside = static_cast<double>(outside.num_covered) / outside.num;
    }
    if (num_chosen > 0) summary.right_model = static_cast<double>(num_right) / num_chosen;
    if (!pixel_sigmas.empty()) summary.pixel_sigma_px = Median(pixel_sigmas);
    if (!translations.empty()) summary.robot_noise = RobotNoise{Median(translations), Median(rotations)};
    summaries.push_back(std::move(summary));
  }
  return summaries;
}

}  // namespace heba
