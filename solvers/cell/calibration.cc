#include "heba/calibration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/diagnostics.h"
#include "solvers/calibration/model_search.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/cell/calibration_stages.h"
#include "solvers/cell/camera_motion.h"
#include "solvers/cell/diagnosis.h"
#include "solvers/cell/outliers.h"
#include "solvers/cell/rejection.h"
#include "solvers/cell/start.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"
#include "solvers/uncertainty/unknown_change.h"

namespace heba {
namespace {

// Returns the images whose captures the calibrations of the pairs rejected.
ImageSet RejectedByPairs(const Problem& problem, const std::vector<CalibratedPair>& pairs) {
  ImageSet rejected;
  for (const CalibratedPair& pair : pairs) {
    if (!pair.calibration || !pair.calibration->refined) continue;
    for (const UnusedView& unused : pair.calibration->unused) {
      const std::vector<ProblemImage>& images = problem.captures[unused.capture].images;
      for (size_t k = 0; k < images.size(); ++k) {
        if (images[k].camera == pair.camera && images[k].target == pair.target) rejected.insert({unused.capture, k});
      }
    }
  }
  return rejected;
}

// Returns the number of images in which an arm moves the target against the camera: they tell its shape.
int NumMovedImages(const Problem& problem, size_t target) {
  return CountImages(problem, [&](const ProblemImage& image) {
    return image.target == target && MovesAgainst(problem.cameras[image.camera].mount, problem.targets[target].mount);
  });
}

// Returns whether an arm moves a target against a camera in one of its images.
bool IsMoved(const Problem& problem, size_t camera) {
  const auto is_moved = [&](const ProblemImage& image) {
    return image.camera == camera && MovesAgainst(problem.cameras[camera].mount, problem.targets[image.target].mount);
  };
  return CountImages(problem, is_moved) > 0;
}

// Returns a problem with the shapes free of the targets that arms move against cameras, and the twists unless errors of
// arms are searched for.
Problem WithFreeShapes(Problem problem, bool knows_arms) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    std::vector<TargetShapeGroup>& shape = problem.targets[t].free_shape;
    shape.clear();
    if (NumMovedImages(problem, t) == 0) continue;
    shape = WithGroup(TargetShapeCombinations().back(), TargetShapeGroup::kTwist, !knows_arms);
  }
  return problem;
}

// Returns the choice among the shapes of these targets.
ModelSpace MovedShapes(const Problem& problem) {
  ModelSpace space;
  for (size_t t = 0; t < problem.targets.size(); ++t) space.shapes.push_back(NumMovedImages(problem, t) > 0);
  space.twists = space.shapes;
  return space;
}

// Returns a problem that holds the shape of the target about which the images tell least; nothing if all are held.
std::optional<Problem> WithShapeHeld(Problem problem) {
  ProblemTarget* least = nullptr;
  int fewest_images = 0;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (problem.targets[t].free_shape.empty()) continue;
    const int num_images = NumMovedImages(problem, t);
    if (least != nullptr && num_images >= fewest_images) continue;
    least = &problem.targets[t];
    fewest_images = num_images;
  }
  if (least == nullptr) return std::nullopt;
  least->free_shape.clear();
  return problem;
}

// Returns a calibration without the images of a camera on one side of its motion.
Calibration WithoutPart(Calibration calibration, const MovedCamera& moved) {
  Problem& problem = calibration.problem;
  const std::string reason = WhyLeftOut(problem, moved);
  for (const size_t i : moved.left_out) {
    for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
      ProblemImage& image = problem.captures[i].images[k];
      if (image.camera != moved.camera || image.observations.size() == 0) continue;
      image.observations = Observations();
      calibration.unused.push_back({i, k, reason});
    }
  }
  calibration.moved.push_back(moved);
  return calibration;
}

// Describes how an image contradicts the others.
std::string WhyWrong(const Problem& problem, const Solution& solution, const ImageIndex& index, double p_value) {
  const ProblemImage& image = problem.captures[index.capture].images[index.image];
  const Rigid3d predicted = CameraFromTarget(problem, solution.poses, image.camera, image.target,
                                             WithErrors(problem.captures[index.capture], solution.effects));
  const std::vector<TargetPose> poses =
      EstimateTargetPose(solution.cameras[image.camera], ApplyShape(image.observations, solution.shapes[image.target]));
  const TargetPose* const seen = NearestPose(poses, predicted);
  if (seen == nullptr) return "its points do not fit the target: probably misread";
  const Rigid3d step = Inverse(predicted) * seen->camera_from_target;
  return "contradicts the other images: the target is " + Significant(1000 * step.translation.norm(), 2) + " mm and " +
         Significant(RadToDeg(RotationAngle(step.rotation)), 2) +
         " deg from where they predict it (probability by chance: " + ShownPValue(p_value) + ")";
}

// Lists the images that are left out. All images that an arm moved in one capture, if there are several, are listed as
// the capture: they agree that its pose is wrong.
std::vector<UnusedProblemImage> Describe(const Problem& problem, const JudgedProblem& judged) {
  const Problem used = UsedPoints(problem, judged);
  std::map<std::pair<size_t, size_t>, double> p_values;
  for (const ImageVerdict& verdict : TestLeftOutImages(problem, used, judged.solution)) {
    p_values[{verdict.image.capture, verdict.image.image}] = verdict.p_value;
  }
  std::vector<UnusedProblemImage> unused;
  ImageSet told;
  for (const std::pair<size_t, size_t>& place : judged.left_out) {
    const size_t capture = place.first;
    const size_t image = place.second;
    if (told.contains(place)) continue;
    const ProblemImage& of_image = problem.captures[capture].images[image];
    for (size_t r = 0; r < problem.robots.size(); ++r) {
      const std::vector<size_t> moved = ImagesMovedBy(problem, capture, r);
      const bool is_moved = std::find(moved.begin(), moved.end(), image) != moved.end();
      const bool all_left_out = std::all_of(moved.begin(), moved.end(), [&](size_t k) {
        return judged.left_out.contains({capture, k});
      });
      if (!is_moved || moved.size() < 2 || !all_left_out) continue;
      for (const size_t k : moved) told.insert({capture, k});
      const bool is_whole = moved.size() == problem.captures[capture].images.size();
      const std::string reason = "all " + std::to_string(moved.size()) + " images contradict the pose of arm " +
                                 problem.robots[r] + "; camera " + problem.cameras[of_image.camera].name + " " +
                                 WhyWrong(problem, judged.solution, {capture, image}, p_values[{capture, image}]);
      if (is_whole) unused.push_back({capture, std::nullopt, reason});
      for (size_t k = 0; k < moved.size() && !is_whole; ++k) unused.push_back({capture, moved[k], reason});
      break;
    }
    if (told.contains({capture, image})) continue;
    unused.push_back(
        {capture, image, WhyWrong(problem, judged.solution, {capture, image}, p_values[{capture, image}])});
  }
  return unused;
}

// Returns whether errors of an arm are searched for, which make what looks like a motion of a camera without them.
bool KnowsArms(const CalibrationOptions& options) {
  return std::any_of(options.arms.begin(), options.arms.end(),
                     [](const ArmErrorModels& arm) { return !arm.models.empty(); });
}

// A calibration without the images of moved cameras, and its model with the errors of arms.
struct CalibrationAtRest {
  StartedCalibration started;  // Its adjustment fails if one without the images does.
  ModelWithArmErrors found;
};

// Leaves out the images of cameras on one side of their motions, if these are looked for: two motions of one camera, or
// those of several cameras, are found one after the other. `with_arm_errors` makes errors of arms part of the model
// before a motion is looked for.
CalibrationAtRest WithoutMotions(StartedCalibration started, const CalibrationOptions& options, bool looks_for_motions,
                                 const std::function<ModelWithArmErrors(const SearchedModel&)>& with_arm_errors) {
  const int most_motions = !looks_for_motions || options.adjustment.loss == LossKind::kNone ? 0 : kMostMotions;
  ModelWithArmErrors found;
  for (int motion = 0; started.judged; ++motion) {
    found = with_arm_errors({started.calibration.problem, options.adjustment, *started.judged});
    if (motion == most_motions) break;
    const std::optional<MovedCamera> moved =
        FindMovedCamera(found.model.problem, found.model.judged, options.adjustment);
    if (!moved) break;
    started.calibration = WithoutPart(std::move(started.calibration), *moved);
    const Problem& rig = started.calibration.problem;
    const JudgedProblem& judged = *started.judged;
    started.judged = RefineWithoutOutliers(rig, judged.solution.poses,
                                           ImagesOfOthers(rig, judged.left_out, moved->camera), options.adjustment);
  }
  return {std::move(started), std::move(found)};
}

// Returns the model with the shapes of targets that its images require, beside the errors of arms, which resemble
// twists.
Outcome<SearchedModel> WithChosenShapes(const ModelWithArmErrors& found) {
  const bool has_arm_errors =
      std::any_of(found.arms.begin(), found.arms.end(), [](const ArmErrorChoice& arm) { return arm.model != nullptr; });
  ModelSpace shapes = MovedShapes(found.model.problem);
  const std::vector<bool> twists = shapes.twists;
  if (has_arm_errors) shapes.twists.clear();
  Outcome<SearchedModel> chosen = WithChosenParts(found.model, shapes, LeaveOutOutliers);
  if (!chosen || !has_arm_errors) return chosen;
  return WithChosenTwists(*chosen, twists);
}

// Returns the change from one solution of a problem to another, in the layout of the first one's covariance.
Eigen::VectorXd ChangeBetween(const Problem& problem, const Solution& from, const Solution& to) {
  UnknownChange change(from.covariance.layout);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const ProblemCamera& camera = problem.cameras[c];
    change.SetPose(CameraPoseBlock(camera), from.poses.mount_from_camera[c], to.poses.mount_from_camera[c]);
    change.SetParams(CameraBlock(camera), from.cameras[c].params, to.cameras[c].params);
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const ProblemTarget& target = problem.targets[t];
    change.SetPose(TargetPoseBlock(target), from.poses.mount_from_target[t], to.poses.mount_from_target[t]);
    change.SetParams(TargetShapeBlock(target), from.shapes[t].params, to.shapes[t].params);
  }
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    change.SetPose(BaseBlock(problem.robots[r]), from.poses.world_from_base[r], to.poses.world_from_base[r]);
  }
  return change.vector();
}

}  // namespace

Outcome<StartedCalibration> StartCalibration(const Problem& problem, const CalibrationOptions& options) {
  CHECK(options.arms.empty() || options.arms.size() == problem.robots.size());
  StartedCalibration started;
  Calibration& calibration = started.calibration;
  calibration.problem = problem;
  Problem& rig = calibration.problem;
  Outcome<std::vector<Camera>> cameras = EstimateCameras(problem, options);
  if (!cameras) return cameras.failure();
  for (size_t c = 0; c < rig.cameras.size(); ++c) rig.cameras[c].camera = (*cameras)[c];
  calibration.pairs = CalibratePairs(rig, options);
  if (const std::optional<ShiftedCamera> shifted = FindShiftedCamera(rig, calibration.pairs, options)) {
    return Failure{
        FailureCode("shifted_images"), {{"shift", shifted->shift}}, {{"camera", rig.cameras[shifted->camera].name}}};
  }
  Outcome<CellPoses> start = JoinPairs(rig, calibration.pairs);
  if (!start) return start.failure();
  rig = InChosenOrders(std::move(rig), *start);
  // An outlier in one pair's calibration may be none in the adjustment of all.
  ImageSet left_out;
  if (options.adjustment.loss != LossKind::kNone) left_out = RejectedByPairs(rig, calibration.pairs);
  // A target that differs from its design must not make images outliers.
  if (options.choose_target_shape) rig = WithFreeShapes(std::move(rig), KnowsArms(options));
  started.judged = RefineWithoutOutliers(rig, *start, left_out, options.adjustment);
  while (!started.judged && options.choose_target_shape) {
    std::optional<Problem> held = WithShapeHeld(rig);
    if (!held) break;
    rig = *std::move(held);
    started.judged = RefineWithoutOutliers(rig, *start, left_out, options.adjustment);
  }
  const auto as_it_is = [](const SearchedModel& model) { return ModelWithArmErrors{model, {}}; };
  return WithoutMotions(std::move(started), options, !KnowsArms(options), as_it_is).started;
}

Calibration FirstAdjustment(const StartedCalibration& started) {
  Calibration calibration = started.calibration;
  calibration.problem = Without(std::move(calibration.problem), started.judged->left_out);
  calibration.refined = started.judged->solution;
  return calibration;
}

Calibration FinishCalibration(StartedCalibration started_in, const CalibrationOptions& options) {
  const ErrorSpace space{{}, options.arms, options.smooth, true, options.robot_scale_sigma};
  const auto with_arm_errors = [&](const SearchedModel& model) {
    return WithArmErrors(model, space, LeaveOutOutliers);
  };
  auto [started, found] = WithoutMotions(std::move(started_in), options, KnowsArms(options), with_arm_errors);
  Calibration calibration = std::move(started.calibration);
  Problem& rig = calibration.problem;
  if (!started.judged) {
    calibration.refined = started.judged.failure();
    return calibration;
  }
  calibration.arms = found.arms;
  Outcome<SearchedModel> chosen = options.choose_target_shape ? WithChosenShapes(found) : found.model;
  if (!chosen) {
    rig = std::move(found.model.problem);
    calibration.refined = chosen.failure();
    return calibration;
  }
  ModelWithSmoothErrors smooth = WithSmoothErrors(*chosen, space, LeaveOutOutliers);
  calibration.smooth_errors = std::move(smooth.added);
  rig = std::move(smooth.model.problem);
  JudgedProblem& judged = smooth.model.judged;
  for (UnusedProblemImage& unused : Describe(rig, judged)) calibration.unused.push_back(std::move(unused));
  rig = Without(std::move(rig), judged.left_out);
  // The points that the adjustment did not use keep their entries in `rejected_ids`.
  calibration.refined = std::move(judged.solution);
  return calibration;
}

Outcome<Calibration> Calibrate(const Problem& problem, const CalibrationOptions& options) {
  Outcome<StartedCalibration> started = StartCalibration(problem, options);
  if (!started) return started.failure();
  return FinishCalibration(*std::move(started), options);
}

FitQuality QualityOf(const Calibration& calibration) {
  return {CountImages(calibration.problem, [](const ProblemImage&) { return true; }),
          calibration.refined->pixel_sigmas_px};
}

FitQuality QualityOf(const PairCalibration& calibration) {
  return {static_cast<int>(calibration.views.size()), {calibration.refined->pixel_sigma_px}};
}

bool IsAtLeastAsGood(const FitQuality& calibration, const FitQuality& other) {
  constexpr double kMaxRise = 1.05;
  return calibration.num_images >= other.num_images &&
         std::equal(calibration.pixel_sigmas_px.begin(), calibration.pixel_sigmas_px.end(),
                    other.pixel_sigmas_px.begin(),
                    [](double sigma_px, double of_other) { return sigma_px <= kMaxRise * of_other; });
}

Advice DiagnoseHeldIntrinsics(const Problem& problem, const Calibration& calibration,
                              const AdjustmentOptions& options) {
  const Solution& solution = *calibration.refined;
  Problem at = calibration.problem;
  for (size_t c = 0; c < at.cameras.size(); ++c) at.cameras[c].camera = solution.cameras[c];
  for (size_t t = 0; t < at.targets.size(); ++t) at.targets[t].shape = solution.shapes[t];
  Advice advice;
  for (size_t c = 0; c < at.cameras.size(); ++c) {
    if (!at.cameras[c].free_intrinsics.empty() || !IsMoved(problem, c)) continue;
    Problem freed = at;
    freed.cameras[c].free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                        ParameterGroup::kDistortion};
    for (size_t i = 0; i < freed.captures.size(); ++i) {
      for (size_t k = 0; k < freed.captures[i].images.size(); ++k) {
        ProblemImage& image = freed.captures[i].images[k];
        if (image.camera != c || image.observations.size() > 0) continue;
        image.observations = problem.captures[i].images[k].observations;
      }
    }
    const Outcome<Solution> other = RefineProblem(freed, solution.poses, options);
    if (!other) continue;
    double target_move_m = 0;
    for (size_t t = 0; t < at.targets.size(); ++t) {
      target_move_m =
          std::max(target_move_m, DistanceM(solution.poses.mount_from_target[t], other->poses.mount_from_target[t]));
    }
    std::optional<Finding> finding = JudgeHeldIntrinsics(
        solution.cameras[c], other->cameras[c], other->covariance, CameraBlock(freed.cameras[c]), other->covariance_dof,
        {solution.poses.mount_from_camera[c], other->poses.mount_from_camera[c], target_move_m,
         WorkingDistance(TargetPosesOf(at, solution.poses, solution.effects, c))});
    if (!finding) continue;
    finding->names.emplace_back("of_camera", at.cameras[c].name);
    advice.findings.push_back(std::move(*finding));
    advice.changes.push_back(ChangeBetween(at, solution, *other));
  }
  return advice;
}

std::vector<Finding> DiagnoseCalibration(const Problem& problem, const Calibration& calibration) {
  std::vector<Finding> findings;
  const Solution& solution = *calibration.refined;
  for (const AddedSmoothErrors& of_arm : calibration.smooth_errors) {
    const RobotNoise smooth = SmoothNoiseOf(solution, of_arm.robot).value_or(RobotNoise{});
    const RobotNoise after = solution.robot_noise[of_arm.robot].value_or(RobotNoise{});
    findings.push_back(
        DescribeSmoothErrors({smooth, of_arm.errors->lengths(), after, of_arm.noise_before, of_arm.p_value_without}));
    findings.back().names.emplace_back("of_arm", problem.robots[of_arm.robot]);
  }
  for (const MovedCamera& moved : calibration.moved) findings.push_back(DescribeMotion(problem, moved));
  return findings;
}

}  // namespace heba
