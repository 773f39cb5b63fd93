#include "heba/pair_calibration.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/smooth_errors.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/capture_rejection.h"
#include "solvers/calibration/closed_form_results.h"
#include "solvers/calibration/diagnostics.h"
#include "solvers/calibration/multi_start.h"
#include "solvers/calibration/observability.h"
#include "solvers/calibration/posture_choice.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/calibration/shared_causes.h"
#include "solvers/calibration/smooth_remainder.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/two_step_motion.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"
#include "solvers/initial/usable_views.h"
#include "solvers/refine/pose_refinement.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Adds the views with too few points for a pose of their own that agree with the refined solution, because they still
// contribute to the bundle adjustment, and lists the others as unused. The solution is as it was if the refinement with
// them fails.
PairCalibration WithFewPointViews(PairCalibration calibration, const std::vector<View>& few,
                                  const PairCalibrationOptions& options) {
  const auto unused_view = [](const View& view, const std::string& reason) -> UnusedView {
    return {view.name, view.capture, std::to_string(view.observations.size()) + " points" + reason};
  };
  std::vector<View> joined;
  std::vector<UnusedView> unused;
  std::optional<double> used_rms_px;
  // The reading order of a target with symmetries can only be determined from a pose.
  if (calibration.refined && options.symmetries.size() == 1) {
    const PairSolution& solution = *calibration.refined;
    const std::optional<SquaredErrors> used =
        ReprojectionErrors(solution.hand_eye, solution.camera,
                           ApplyShape(CorrectedViews(options.setup, calibration.views, solution), solution.shape));
    if (used) used_rms_px = used->RmsPx();
    joined = calibration.views;
  }
  for (const View& view : few) {
    if (!used_rms_px || view.observations.size() == 0) {
      unused.push_back(unused_view(view, "; a pose requires 4"));
      continue;
    }
    constexpr double kMaxRatio = 3;
    const PairSolution& solution = *calibration.refined;
    const std::optional<SquaredErrors> errors =
        ViewErrors(solution.camera, CameraFromTarget(solution.hand_eye, CorrectedMount(options.setup, view, solution)),
                   ApplyShape(view.observations, solution.shape));
    if (errors && *errors->RmsPx() <= kMaxRatio * *used_rms_px) {
      joined.push_back(view);
    } else {
      unused.push_back(unused_view(view, ", too few for a pose, and not where the other captures predict them"));
    }
  }
  if (used_rms_px && joined.size() > calibration.views.size()) {
    const PairSolution& solution = *calibration.refined;
    Outcome<PairSolution> refined =
        RefineHandEye({solution.camera, joined, options.setup, solution.shape}, solution.hand_eye, calibration.bundle);
    if (refined) {
      calibration.refined = std::move(refined);
      calibration.views = std::move(joined);
    } else {
      unused.clear();
      for (const View& view : few) unused.push_back(unused_view(view, "; a pose requires 4"));
    }
  }
  calibration.unused.insert(calibration.unused.begin(), unused.begin(), unused.end());
  return calibration;
}

// Returns the initial guesses of the refinement, the preferred one first. Empty if there is none.
std::vector<InitialGuess> SeedsOf(const std::vector<MethodResult>& results, const std::string& wanted,
                                  const PairCalibration& calibration) {
  // Sorted by RMS. A capture without an image under a method's result ranks it last, but the robust scale still orders
  // such methods.
  constexpr double kHides = 1e6;
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < results.size(); ++i) {
    if (!results[i].hand_eye) continue;
    const double scale_px = RobustScalePx(calibration.camera, calibration.views, *results[i].hand_eye);
    if (!results[i].reprojection_rms_px && !std::isfinite(scale_px)) continue;
    order.emplace_back(results[i].method == wanted ? -1 : results[i].reprojection_rms_px.value_or(kHides + scale_px),
                       i);
  }
  std::sort(order.begin(), order.end());
  std::vector<InitialGuess> seeds;
  for (const auto& [rank, i] : order) seeds.push_back({results[i].method, *results[i].hand_eye});
  return seeds;
}

// Describes how a capture's image contradicts its pose, and the likely causes.
std::string WhyWrong(View entry, double p_value, const PairSolution& solution, Setup setup, const std::string& causes) {
  entry = CorrectedViews(setup, {entry}, solution).front();
  entry.observations = ApplyShape(entry.observations, solution.shape);
  const std::vector<PosePair> seen = PosePairsOf(solution.camera, solution.hand_eye, {entry});
  const std::optional<SquaredErrors> own =
      seen.empty() ? std::nullopt : ViewErrors(solution.camera, seen.front().camera_from_target, entry.observations);
  constexpr double kMisfitRatio = 8;
  if (!own || *own->RmsPx() > kMisfitRatio * solution.pixel_sigma_px) {
    return "its points do not fit the target" + (own ? " (" + Significant(*own->RmsPx(), 2) + " px rms)" : "") +
           " and are not where the other captures predict them: probably misread";
  }
  const Rigid3d correction =
      CorrectionFor(setup, solution.hand_eye, entry.camera_mount_from_target_mount, seen.front().camera_from_target);
  return "contradicts the other captures: according to its image, the gripper was " +
         Significant(1000 * correction.translation.norm(), 2) + " mm and " +
         Significant(RadToDeg(AngleRad(Rigid3d(), correction)), 2) +
         " deg from the stated robot pose (probability by chance: " + ShownPValue(p_value) + "); " + causes;
}

// Returns the design of a target, from the views' points if nothing else is known.
TargetShape ShapeOf(const std::vector<View>& views) {
  Eigen::Index num_points = 0;
  for (const View& view : views) num_points += view.observations.size();
  Points3 points(3, num_points);
  Eigen::Index first = 0;
  for (const View& view : views) {
    points.middleCols(first, view.observations.size()) = view.observations.points_in_target;
    first += view.observations.size();
  }
  return num_points > 0 ? DesignedShape(points) : TargetShape();
}

// Returns the problem that consists of the calibration's views.
PairProblem ProblemOf(const PairCalibration& calibration, const PairCalibrationOptions& options) {
  return {calibration.camera, calibration.views, options.setup, options.shape};
}

// Judges the captures with an exact robot and with as many free shape parameters of the target as the captures
// determine, so that a bent target is not mistaken for wrong captures. `model` has a solution without free shape
// parameters.
JudgedProblem JudgeFirst(const SearchedModel& model, bool may_have_shape) {
  Problem problem = model.problem;
  Solution solution = model.judged.solution;
  AdjustmentOptions options = model.options;
  options.robot = BundleOptions::Robot::kExact;
  options.loss = LossKind::kTruncated;
  std::vector<std::vector<TargetShapeGroup>> shapes = TargetShapeCombinations();
  shapes.push_back(shapes.back());
  shapes.back() = WithGroup(std::move(shapes.back()), TargetShapeGroup::kTwist, true);
  std::reverse(shapes.begin(), shapes.end());  // The largest combination that is determined.
  for (const std::vector<TargetShapeGroup>& shape : shapes) {
    if (!may_have_shape || shape.empty()) break;
    Problem open = problem;
    open.targets[0].free_shape = shape;
    Outcome<Solution> of_open = RefineProblem(open, solution.poses, options);
    if (!of_open) continue;
    problem = std::move(open);
    solution = std::move(*of_open);
    break;
  }
  return JudgeCaptures(problem, solution, options);
}

// Tests the captures again under the chosen model if there is a doubt about any.
JudgedProblem SettleDoubts(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  // A calibration that most captures contradict cannot tell the wrong ones.
  const size_t num_used = problem.captures.size() - at.left_out.size();
  const bool can_judge = 2 * static_cast<size_t>(at.num_kept_against_test) <= num_used;
  // Captures that all passed with the noise that was estimated for the test pass with that of the model, too.
  const bool has_doubt = !at.left_out.empty() || at.num_kept_against_test > 0;
  return can_judge && has_doubt ? SettleCaptures(problem, std::move(at), options) : at;
}

// Returns the captures that stay rejected, each with the reason under the final estimate.
std::vector<UnusedView> NamedLeftOut(const PairCalibration& calibration, const PairCalibrationOptions& options) {
  const std::vector<View>& left_out = calibration.left_out;
  if (left_out.empty()) return {};
  std::vector<UnusedView> unused;
  const SearchedModel of_all = AsProblem(calibration, options).model;
  const std::vector<CaptureVerdict> verdicts =
      TestLeftOutCaptures(of_all.problem, of_all.judged.solution, CapturesOf(of_all.judged.left_out));
  const std::vector<std::string> shared = SharedCauses(options.setup, left_out, calibration.views);
  for (size_t k = 0; k < left_out.size(); ++k) {
    const std::string causes =
        shared[k].empty() ? "wrong pose for the image, robot not settled, or target misread" : shared[k];
    unused.push_back({left_out[k].name, left_out[k].capture,
                      WhyWrong(left_out[k], verdicts[k].p_value, *calibration.refined, options.setup, causes)});
  }
  return unused;
}

// Returns a calibration without the points that the refinement rejected, so that all methods and figures use the same
// points; nothing if there are none.
std::optional<PairCalibration> WithoutRejectedPoints(const PairCalibration& calibration) {
  const PairSolution& solution = *calibration.refined;
  const bool has_rejected = std::any_of(solution.views.begin(), solution.views.end(),
                                        [](const ViewOutcome& view) { return !view.rejected_ids.empty(); });
  if (!has_rejected) return std::nullopt;
  // Views that keep enough points for a pose come first; the order within both groups is kept.
  std::vector<size_t> order;
  std::vector<Observations> kept;
  for (size_t i = 0; i < calibration.views.size(); ++i) {
    kept.push_back(WithoutPoints(calibration.views[i].observations, solution.views[i].rejected_ids));
    order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const auto rank = [&](size_t i) { return kept[i].size() >= kMinPosePoints ? 0 : kept[i].size() > 0 ? 1 : 2; };
    return rank(a) < rank(b);
  });
  PairCalibration cleaned = calibration;
  for (size_t k = 0; k < order.size(); ++k) {
    const size_t i = order[k];
    cleaned.views[k] = calibration.views[i];
    cleaned.views[k].observations = kept[i];
    cleaned.refined->views[k] = solution.views[i];
  }
  // A capture without any point is not used.
  while (!cleaned.views.empty() && cleaned.views.back().observations.ids.empty()) {
    const size_t num_points = cleaned.refined->views.back().rejected_ids.size();
    cleaned.unused.push_back(
        {cleaned.views.back().name, cleaned.views.back().capture,
         "none of its " + std::to_string(num_points) +
             " points is where the estimate from the other captures predicts it: the target was probably "
             "misread, or the robot pose belongs to another image"});
    cleaned.views.pop_back();
    cleaned.refined->views.pop_back();
  }
  for (size_t i = 0; i < solution.views.size(); ++i) {
    if (!solution.views[i].rejected_ids.empty()) cleaned.with_rejected.push_back(calibration.views[i]);
  }
  cleaned.pairs = PosePairsOf(cleaned.camera, solution.hand_eye, cleaned.views);
  return cleaned;
}

// A camera to start with, and the groups of its intrinsics that are free.
struct CameraStart {
  Camera camera;
  std::vector<ParameterGroup> free_intrinsics;
};

struct CameraStarts {
  // The wanted start, then those that leave less to be determined.
  std::vector<CameraStart> starts;
  std::vector<Camera> candidates;               // AutoModel::lenses.
  std::vector<CameraAlternative> alternatives;  // PairCalibration::camera_alternatives.
  std::vector<std::string> smaller_models;      // Models that are estimated if the starts fail.
  Failure refused;                              // Why the wanted camera could not be estimated; empty if it could.
};

// Returns starts that hold one more group of the intrinsics each.
std::vector<CameraStart> HeldStarts(const Camera& camera, std::vector<ParameterGroup> free) {
  std::vector<CameraStart> starts;
  for (const ParameterGroup group :
       {ParameterGroup::kDistortion, ParameterGroup::kPrincipalPoint, ParameterGroup::kFocal}) {
    const size_t num_freed = std::erase(free, group);
    if (num_freed > 0) starts.push_back({camera, free});
  }
  return starts;
}

// Returns the starts together with those of the smaller models, and those that hold the intrinsics that the captures by
// themselves determine.
CameraStarts WithSmallerStarts(CameraStarts cameras, const std::vector<View>& views,
                               const PairCalibrationOptions& options) {
  const std::vector<ParameterGroup>& free = options.bundle.free_intrinsics;
  for (const std::string& model : cameras.smaller_models) {
    Outcome<Camera> camera = EstimateIntrinsics(views, model, options.width_px, options.height_px);
    if (camera) cameras.starts.push_back({std::move(*camera), free});
  }
  cameras.smaller_models.clear();
  if (cameras.starts.empty() || options.camera) return cameras;
  for (CameraStart& held : HeldStarts(cameras.starts.back().camera, free)) cameras.starts.push_back(std::move(held));
  return cameras;
}

// Returns the cameras to start with. Returns a Failure if none can be estimated.
Outcome<CameraStarts> FindCameraStarts(const std::vector<View>& views, const PairCalibrationOptions& options) {
  const std::vector<ParameterGroup>& free = options.bundle.free_intrinsics;
  CameraStarts cameras;
  if (options.camera) {
    cameras.starts.push_back({*options.camera, free});
    for (CameraStart& held : HeldStarts(*options.camera, free)) cameras.starts.push_back(std::move(held));
    return cameras;
  }
  if (options.choose_camera_model) {
    Outcome<CameraChoice> choice = ChooseCameraModel(views, options.width_px, options.height_px);
    if (!choice) return choice.failure();
    cameras.alternatives = std::move(choice->alternatives);
    cameras.candidates = std::move(choice->candidates);
    cameras.starts.push_back({choice->camera, free});
    // The largest of the smaller lenses comes next, then the other ones.
    std::vector<Camera> others = cameras.candidates;
    std::stable_sort(others.begin(), others.end(), [&](const Camera& a, const Camera& b) {
      const auto rank = [&](const Camera& camera) {
        const bool is_smaller = camera.params.size() <= choice->camera.params.size();
        return std::pair(!is_smaller, is_smaller ? -static_cast<int>(camera.params.size()) : 0);
      };
      return rank(a) < rank(b);
    });
    for (Camera& other : others) {
      if (other.model != choice->camera.model) cameras.starts.push_back({std::move(other), free});
    }
  } else {
    const Outcome<Camera> wanted =
        EstimateIntrinsics(views, options.camera_model, options.width_px, options.height_px, options.camera_start);
    if (wanted) {
      cameras.starts.push_back({*wanted, free});
    } else {
      cameras.refused = wanted.failure();
    }
    cameras.smaller_models = SmallerCameraModels(options.camera_model);
    if (!wanted) cameras = WithSmallerStarts(std::move(cameras), views, options);
    if (cameras.starts.empty()) return cameras.refused;
  }
  return cameras;
}

// A calibration up to its first refinement, with an exact robot and the target as designed.
struct Started {
  PairCalibration calibration;
  std::vector<View> too_few;  // The views with too few points for a pose.
  std::vector<MethodResult> results;
  size_t num_posed = 0;  // Number of views with a pose.
  std::vector<ParameterGroup> free_intrinsics;
};

// Returns the reason why there is no start: that of the method that was asked for, if it failed, or of all methods.
Failure WhyNoStart(const std::vector<MethodResult>& results, const MethodResult* wanted) {
  Failure reason;
  if (wanted != nullptr && !wanted->hand_eye) reason = wanted->hand_eye.failure();
  // If the motion is the cause, all methods fail for the same reason.
  for (const MethodResult& result : results) {
    const bool suits = FindHandEyeMethod(result.method)->motion == MethodMotion::kAny;
    if (reason.empty() && suits && !result.hand_eye) reason = result.hand_eye.failure();
  }
  return reason.empty() ? Failure(FailureCode("target_behind")) : reason;
}

// Returns the options of the first refinement. Wrong captures are searched for with an exact robot first, because robot
// noise could absorb their errors.
BundleOptions FirstBundle(const PairCalibrationOptions& options, const std::vector<ParameterGroup>& free_intrinsics) {
  BundleOptions first = options.bundle;
  first.robot = BundleOptions::Robot::kExact;
  first.free_intrinsics = free_intrinsics;
  // Errors that captures share are no reason to reject those in which they are large.
  if (!options.choose.effects.empty()) first.effects = options.choose.effects.back();
  if (options.bundle.loss != LossKind::kNone) first.loss = LossKind::kTruncated;
  return first;
}

// Refines from all seeds, with a free scale of the target if that is required and possible.
MultiStartSolution RefineFirst(const PairCalibration& calibration, const PairCalibrationOptions& options,
                               const std::vector<InitialGuess>& seeds, const BundleOptions& first) {
  MultiStartSolution refined =
      RefineFromMultipleStarts(ProblemOf(calibration, options), calibration.pairs, seeds, first);
  if (!refined.solution && options.choose.target_shape) {
    // A target whose size differs from the design leaves residuals that can prevent the refinement with a free camera.
    BundleOptions scaled = first;
    scaled.free_shape = {TargetShapeGroup::kScale};
    MultiStartSolution other =
        RefineFromMultipleStarts(ProblemOf(calibration, options), calibration.pairs, seeds, scaled);
    if (other.solution) return other;
  }
  return refined;
}

// Views with the poses of the target in them, and the closed forms of these poses.
struct PosedViews {
  PairCalibration calibration;         // Has the camera, the views with a pose and their pairs.
  std::vector<View> too_few;           // The views with too few points for a pose.
  std::vector<View> misfits;           // The views whose points fit no pose.
  std::vector<UnusedView> of_misfits;  // Why; one for each.
  std::vector<MethodResult> results;
};

PosedViews PoseViews(const std::vector<View>& views, const PairCalibrationOptions& options, const Camera& camera) {
  PosedViews posed;
  PairCalibration& calibration = posed.calibration;
  calibration.camera = camera;
  SortedViews sorted = SortViews(views, calibration.camera);
  posed.too_few = std::move(sorted.too_small);
  calibration.views = std::move(sorted.posed);
  for (size_t i = 0; i < sorted.misfits.size(); ++i) {
    posed.of_misfits.push_back({sorted.misfits[i].name, sorted.misfits[i].capture, sorted.misfit_reasons[i]});
  }
  posed.misfits = std::move(sorted.misfits);
  const bool has_roles =
      std::any_of(views.begin(), views.end(), [](const View& view) { return view.role != CaptureRole::kNone; });
  if (!has_roles) {
    const std::vector<CaptureRole> roles = FindTwoStepRoles(options.setup, calibration.views);
    for (size_t i = 0; i < roles.size(); ++i) calibration.views[i].role = roles[i];
  }
  const ChosenPoses chosen = ChoosePoses(calibration.camera, calibration.views, sorted.poses, options.symmetries);
  calibration.pairs = chosen.pairs;
  for (size_t i = 0; i < calibration.views.size(); ++i) {
    const Rigid3d& symmetry = options.symmetries[static_cast<size_t>(chosen.symmetry[i])];
    Points3& points = calibration.views[i].observations.points_in_target;
    points = ((symmetry.RotationMatrix() * points).colwise() + symmetry.translation).eval();
  }
  posed.results = RunMethods(calibration, chosen.solutions);
  return posed;
}

Started StartFrom(const std::vector<View>& views, const PairCalibrationOptions& options, const CameraStart& start) {
  PosedViews posed = PoseViews(views, options, start.camera);
  Started started;
  started.free_intrinsics = start.free_intrinsics;
  started.too_few = std::move(posed.too_few);
  started.results = std::move(posed.results);
  started.calibration = std::move(posed.calibration);
  PairCalibration& calibration = started.calibration;
  started.num_posed = calibration.views.size();
  const MethodResult* wanted = options.seed == kBestSeed ? nullptr : FindResult(started.results, options.seed);
  CHECK(options.seed == kBestSeed || wanted != nullptr) << options.seed;
  const std::vector<InitialGuess> seeds = SeedsOf(started.results, options.seed, calibration);
  if (seeds.empty() || (wanted != nullptr && !wanted->hand_eye)) {
    calibration.unused = std::move(posed.of_misfits);
    calibration.refined = WhyNoStart(started.results, wanted);
    return started;
  }
  // A view with some wrong points has other points, which the truncated loss separates.
  const bool drops_wrong = options.bundle.loss != LossKind::kNone;
  if (drops_wrong && options.symmetries.size() == 1) {
    for (View& misfit : posed.misfits) calibration.views.push_back(std::move(misfit));
  } else {
    calibration.unused = std::move(posed.of_misfits);
  }
  MultiStartSolution refined = RefineFirst(calibration, options, seeds, FirstBundle(options, start.free_intrinsics));
  calibration.seed = refined.seed;
  calibration.refined = std::move(refined.solution);
  return started;
}

// Returns the pairs with the poses of the target for the camera of the calibration and captures that were taken back. A
// capture without a pose keeps those after it from having one.
std::vector<PosePair> UpdatedPairs(const PairCalibration& calibration) {
  std::vector<View> posed = calibration.views;
  std::vector<PosePair> pairs = PosePairsOf(calibration.camera, calibration.refined->hand_eye, posed);
  if (pairs.size() != posed.size()) {
    posed.resize(calibration.pairs.size());
    pairs = PosePairsOf(calibration.camera, calibration.refined->hand_eye, posed);
  }
  if (pairs.size() != posed.size()) return calibration.pairs;
  return pairs;
}

// Returns the groups of the target's shape that a finding `target_shape_ignored` names; none without one.
std::vector<TargetShapeGroup> IgnoredShape(const Advice& of_model) {
  std::vector<TargetShapeGroup> groups;
  for (const Finding& finding : of_model.findings) {
    if (finding.code != "target_shape_ignored") continue;
    for (const Finding& part : finding.parts) {
      groups.push_back(part.code == "shape_scale"   ? TargetShapeGroup::kScale
                       : part.code == "shape_bend"  ? TargetShapeGroup::kBend
                       : part.code == "shape_twist" ? TargetShapeGroup::kTwist
                                                    : TargetShapeGroup::kCubic);
    }
  }
  return groups;
}

// Returns whether a held shape of the target that contradicts the captures is why the held intrinsics do, too: the
// intrinsics agree with a free shape, but free intrinsics do not agree with the held one.
bool IsShapeAlone(const Advice& of_camera, const Advice& of_model, const PairProblem& solved,
                  const PairSolution& solution, const BundleOptions& bundle, const AutoModel& choose) {
  const std::vector<TargetShapeGroup> shape = IgnoredShape(of_model);
  if (of_camera.findings.empty() || shape.empty()) return false;
  PairProblem at = solved;
  at.camera = solution.camera;
  BundleOptions free = bundle;
  free.loss = OfInliers(bundle.loss);
  free.free_shape = shape;
  const Outcome<PairSolution> with_shape = RefineHandEye(at, solution.hand_eye, free);
  if (!with_shape || !DiagnoseHeldIntrinsics(solved, *with_shape, free, choose).findings.empty()) return false;
  free.free_shape = bundle.free_shape;
  free.free_intrinsics = BundleOptions().free_intrinsics;
  const Outcome<PairSolution> with_intrinsics = RefineHandEye(at, solution.hand_eye, free);
  return with_intrinsics && !IgnoredShape(DiagnoseModel(solved, *with_intrinsics, free, choose)).empty();
}

std::string GroupNames(const std::vector<ParameterGroup>& groups) {
  std::vector<std::string> names;
  for (const ParameterGroup group : groups) names.emplace_back(kParameterGroupNames[static_cast<size_t>(group)]);
  return Join(names, ", ");
}

// Returns the models that were compared without smooth errors, and the model with them, which was compared with the
// chosen one of those.
std::vector<ModelAlternative> AllComparedModels(const PairCalibration& calibration, const AddedSmoothErrors& found,
                                                const PairCalibration& before) {
  const ErrorModel without{before.bundle.robot, before.bundle.free_shape, before.bundle.effects};
  const ErrorModel with{calibration.bundle.robot, before.bundle.free_shape, calibration.bundle.effects};
  std::vector<ModelAlternative> all = before.alternatives;
  auto chosen = std::find_if(all.begin(), all.end(), [&](const ModelAlternative& one) {
    return one.model.robot == without.robot && one.model.shape == without.shape && one.model.effects == without.effects;
  });
  if (chosen == all.end()) {
    chosen = all.insert(all.end(), {without, 0, before.refined->robot_noise, DofOf(without), std::nullopt});
  }
  chosen->p = found.p_value_without;
  chosen->odds = found.odds_without;
  const double log_likelihood = chosen->log_likelihood + found.log_likelihood_gain;
  all.push_back({with, log_likelihood, calibration.refined->robot_noise, DofOf(with), std::nullopt});
  return all;
}

// Returns a calibration with the points that the refinement rejected.
PairCalibration WithRejectedPoints(PairCalibration calibration) {
  for (View& before : calibration.with_rejected) {
    const auto used = std::find_if(calibration.views.begin(), calibration.views.end(),
                                   [&](const View& view) { return view.capture == before.capture; });
    if (used != calibration.views.end()) {
      used->observations = std::move(before.observations);
      continue;
    }
    std::erase_if(calibration.unused, [&](const UnusedView& unused) { return unused.capture == before.capture; });
    calibration.views.push_back(std::move(before));
    ViewOutcome& outcome = calibration.refined->views.emplace_back();
    if (calibration.refined->robot_noise) outcome.correction = Rigid3d();
  }
  calibration.with_rejected.clear();
  return calibration;
}

// Returns a calibration at its end: with the captures that are left out named, without rejected points, and with the
// methods on what is used. `has_methods`: whether their results are there already, for these captures with this camera.
PairCalibration Finished(PairCalibration calibration, const PairCalibrationOptions& options, bool has_methods) {
  if (calibration.refined) {
    const std::vector<UnusedView> left_out = NamedLeftOut(calibration, options);
    calibration.unused.insert(calibration.unused.end(), left_out.begin(), left_out.end());
    if (!has_methods) calibration.pairs = UpdatedPairs(calibration);
    if (std::optional<PairCalibration> cleaned = WithoutRejectedPoints(calibration)) {
      calibration = *std::move(cleaned);
      has_methods = false;
    }
  }
  if (!has_methods) calibration.methods = RunMethods(calibration);
  calibration.methods = Reported(calibration.methods, options.methods);
  if (calibration.refined) calibration.chain = RefineChain(calibration.pairs, calibration.refined->hand_eye);
  return calibration;
}

// Returns whether a calibration has another camera, or holds more of it, than the options ask for.
bool IsReduced(const PairCalibration& calibration, const PairCalibrationOptions& wanted) {
  const bool has_other_model =
      !wanted.camera && !wanted.choose_camera_model && calibration.camera.model != wanted.camera_model;
  return has_other_model || calibration.bundle.free_intrinsics != wanted.bundle.free_intrinsics;
}

}  // namespace

Outcome<PairCalibration> CalibratePair(const std::vector<View>& views, const PairCalibrationOptions& options_in) {
  PairCalibrationOptions options = options_in;
  if (options.shape.half_size_m.isZero(0)) options.shape = ShapeOf(views);
  Outcome<CameraStarts> cameras = FindCameraStarts(views, options);
  if (!cameras) return cameras.failure();
  options.choose.lenses = cameras->candidates;
  // A camera that the captures do not determine steps down to one that they do.
  Started started = StartFrom(views, options, cameras->starts.front());
  Failure refused = cameras->refused;
  if (!started.calibration.refined && refused.empty()) {
    cameras = WithSmallerStarts(*std::move(cameras), views, options);
  }
  for (size_t k = 1; k < cameras->starts.size() && !started.calibration.refined; ++k) {
    Started other = StartFrom(views, options, cameras->starts[k]);
    if (!other.calibration.refined) continue;
    if (refused.empty()) refused = started.calibration.refined.failure();
    started = std::move(other);
  }
  options.bundle.free_intrinsics = started.free_intrinsics;
  PairCalibration calibration = std::move(started.calibration);
  calibration.camera_was_given = options.camera.has_value();
  calibration.camera_alternatives = cameras->alternatives;
  if (calibration.refined && started.free_intrinsics != options_in.bundle.free_intrinsics) {
    // The other lenses are candidates only if their parameters are free.
    options.choose.lenses.clear();
  }
  calibration.bundle = options.bundle;
  std::vector<MethodResult> results = std::move(started.results);
  if (!calibration.refined) {
    calibration.methods = Reported(results, options.methods);
    return WithFewPointViews(std::move(calibration), started.too_few, options);
  }
  calibration.methods = std::move(results);
  const std::string start_model = calibration.camera.model;
  CalibrationProblem problem = AsProblem(calibration, options);
  if (options.bundle.loss != LossKind::kNone) {
    problem.model.judged = JudgeFirst(problem.model, options.choose.target_shape);
  }
  problem.model.is_fitted = false;  // With an exact robot, and maybe another shape.
  Outcome<SearchedModel> chosen = WithChosenParts(problem.model, SpaceOf(options, problem), SettleDoubts);
  if (chosen) {
    problem.model = *std::move(chosen);
    calibration =
        WithModelOf(std::move(calibration), problem, options.choose.effects.empty() ? options.bundle.effects : nullptr);
    // The captures did not determine the camera.
    if (IsReduced(calibration, options_in)) calibration.reduced_camera = refused;
  } else {
    calibration.refined = chosen.failure();
  }
  const bool has_methods = calibration.pairs.size() == started.num_posed && calibration.left_out.empty() &&
                           calibration.camera.model == start_model;
  return WithFewPointViews(Finished(std::move(calibration), options, has_methods), started.too_few, options);
}

Outcome<PairCalibration> CalibratePart(const PairCalibration& full, const std::vector<View>& part,
                                       const PairCalibrationOptions& options_in) {
  CHECK(full.refined.ok());
  PairCalibrationOptions options = options_in;
  options.symmetries = {Rigid3d()};  // The views are in the reading order that was chosen.
  options.choose = {};
  options.choose_camera_model = false;
  options.bundle = full.bundle;
  options.bundle.num_threads = options_in.bundle.num_threads;
  options.bundle.loss = OfInliers(full.bundle.loss);
  options.camera_model = full.camera.model;
  if (!options.camera) options.camera_start = full.camera;
  if (options.shape.half_size_m.isZero(0)) options.shape = ShapeOf(full.views);
  const Outcome<CameraStarts> cameras = FindCameraStarts(part, options);
  if (!cameras) return cameras.failure();
  PosedViews posed = PoseViews(part, options, cameras->starts.front().camera);
  PairCalibration calibration = std::move(posed.calibration);
  calibration.camera_was_given = full.camera_was_given;
  calibration.bundle = options.bundle;
  calibration.methods = Reported(posed.results, options.methods);
  for (std::vector<View>* others : {&posed.misfits, &posed.too_few}) {
    std::move(others->begin(), others->end(), std::back_inserter(calibration.views));
  }
  calibration.seed = full.seed;
  BundleOptions near_full = calibration.bundle;
  AdjustmentOptions& near_noise = near_full;
  near_noise = StartingFromNoise(near_noise, {full.refined->pixel_sigma_px}, full.refined->robot_noise);
  if (near_full.effects != nullptr) near_full.effects = StartingFrom(*near_full.effects, full.refined->effect_sigmas);
  calibration.refined = RefineHandEye(ProblemOf(calibration, options), full.refined->hand_eye, near_full);
  if (calibration.refined) calibration.chain = RefineChain(calibration.pairs, calibration.refined->hand_eye);
  return calibration;
}

RobotErrorsFound CalibrateRobotErrors(const PairCalibration& before, const PairCalibrationOptions& options,
                                      const RobotErrors& errors) {
  CHECK(before.refined.ok());
  RobotErrorsFound found{before, options, std::nullopt, std::nullopt};
  PairCalibration calibration = WithRejectedPoints(before);
  CalibrationProblem problem = InOrder(AsProblem(calibration, options));
  ErrorSpace space;
  space.parts = SpaceOf(options, problem);
  space.smooth = errors.smooth;
  space.robot_scale_sigma = errors.robot_scale_sigma;
  ArmErrorModels& arm = space.arms.emplace_back(errors.arm);
  const auto of_views = [&](const auto& of_captures) {
    auto entries = of_captures;
    entries.clear();
    for (const View& view : problem.views) entries.push_back(of_captures[view.capture]);
    return entries;
  };
  for (auto& effects : arm.effects_of_captures) effects = of_views(effects);
  for (auto& joints : arm.joints_of_captures) joints = of_views(joints);
  for (auto& positions : arm.positions_of_captures) positions = of_views(positions);
  ModelWithArmErrors of_arm = WithArmErrors(problem.model, space, SettleCaptures);
  if (!of_arm.arms.empty()) found.arm = std::move(of_arm.arms.front());
  ModelWithSmoothErrors smooth = WithSmoothErrors(of_arm.model, space, SettleCaptures);
  if (!smooth.added.empty()) found.smooth = std::move(smooth.added.front());
  problem.model = std::move(smooth.model);
  const bool has_arm = found.arm && found.arm->reason.empty();
  if (!has_arm && !found.smooth) return found;

  PairCalibrationOptions& with_errors = found.options;
  with_errors.bundle.free_intrinsics = before.bundle.free_intrinsics;
  with_errors.bundle.target_scale_sigma = problem.model.problem.targets[0].scale_sigma;
  for (size_t i = 0; i < problem.views.size(); ++i) {
    View& view = problem.views[i];
    if (has_arm && found.arm->model != nullptr) view.effect = arm.effects_of_captures[found.arm->branches[i]][i];
    const std::vector<ArmPosture>& postures = problem.model.problem.captures[i].postures;
    if (has_arm && !postures.empty()) view.gripper_by_joints = postures.front().gripper_by_joints;
    if (found.smooth) {
      view.effect = found.smooth->errors->EffectAt(BaseFromGripper(options.setup, view.camera_mount_from_target_mount));
    }
  }
  std::shared_ptr<const SharedEffects> fixed;
  if (has_arm && arm.is_chosen) with_errors.choose.effects = arm.models;
  if (has_arm && !arm.is_chosen && !arm.models.empty()) fixed = arm.models.back();
  if (found.smooth) {
    fixed = problem.model.problem.effects[0];
    with_errors.choose.robot_noise = false;
    with_errors.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  }
  with_errors.bundle.effects = fixed;
  std::erase_if(calibration.unused, [&](const UnusedView& unused) {
    return std::any_of(before.left_out.begin(), before.left_out.end(),
                       [&](const View& view) { return view.capture == unused.capture; });
  });
  if (has_arm) {
    std::vector<size_t> captures;
    for (const View& view : problem.views) captures.push_back(view.capture);
    found.arm->branches = BranchesOfAll(errors.arm, captures, found.arm->branches);
  }
  calibration = Finished(WithModelOf(std::move(calibration), problem, fixed), with_errors, false);
  if (found.smooth) calibration.alternatives = AllComparedModels(calibration, *found.smooth, before);
  found.calibration = std::move(calibration);
  return found;
}

Covariance WithChanges(Covariance covariance, const std::vector<Eigen::VectorXd>& changes) {
  for (const Eigen::VectorXd& change : changes) {
    CHECK_EQ(change.size(), covariance.matrix.rows());
    covariance.matrix += change * change.transpose();
  }
  return covariance;
}

Advice Advise(const PairCalibration& calibration, const PairCalibrationOptions& options) {
  const PairSolution& solution = *calibration.refined;
  const BundleOptions& bundle = calibration.bundle;
  const PairProblem solved = ProblemOf(calibration, options);
  const ErrorModel model{bundle.robot, bundle.free_shape, bundle.effects};
  Advice advice;
  const auto add = [&](std::optional<Finding> finding) {
    if (finding) advice.findings.push_back(std::move(*finding));
  };
  const auto append = [&](const Advice& of_held) {
    advice.findings.insert(advice.findings.end(), of_held.findings.begin(), of_held.findings.end());
    advice.changes.insert(advice.changes.end(), of_held.changes.begin(), of_held.changes.end());
  };
  const Advice of_model = DiagnoseModel(solved, solution, bundle, options.choose);
  if (calibration.camera_was_given) {
    const Advice of_camera = DiagnoseHeldIntrinsics(solved, solution, bundle, options.choose);
    if (!IsShapeAlone(of_camera, of_model, solved, solution, bundle, options.choose)) append(of_camera);
    add(DescribeCameraUse(calibration.camera, solution, bundle));
  }
  append(of_model);
  if (calibration.num_kept_against_test > 0) {
    const bool is_most = 2 * static_cast<size_t>(calibration.num_kept_against_test) > calibration.views.size();
    Finding finding{is_most ? Grade::kBad : Grade::kDoubtful,
                    is_most ? FindingCode("captures_contradict") : FindingCode("captures_scatter"),
                    {{"captures", calibration.num_kept_against_test},
                     {"of_captures", static_cast<double>(calibration.views.size())}}};
    finding.is_cause = is_most;
    add(std::move(finding));
  }
  if (!calibration.reduced_camera.empty()) {
    Finding finding{Grade::kDoubtful, FindingCode("camera_reduced")};
    finding.names = {{"model", solution.camera.model},
                     {"wanted", options.camera ? solution.camera.model : options.camera_model},
                     {"free", GroupNames(bundle.free_intrinsics)}};
    finding.reason = calibration.reduced_camera;
    finding.is_cause = true;
    add(std::move(finding));
  }
  // An earlier session knows the noise of this robot.
  const bool is_assumed = bundle.robot_noise_prior && bundle.prior == nullptr;
  if (is_assumed && bundle.robot == BundleOptions::Robot::kEstimatedNoise) {
    add(Finding{Grade::kDoubtful,
                FindingCode("few_captures_prior"),
                {{"fewer_than", static_cast<double>(kMinPosesForVariances)},
                 {"least_robot_mm", 1000 * kIndustrialArmM[0]},
                 {"most_robot_mm", 1000 * kIndustrialArmM[1]},
                 {"least_robot_deg", kIndustrialArmDeg[0]},
                 {"most_robot_deg", kIndustrialArmDeg[1]}}});
  }
  const bool has_arm = bundle.effects != nullptr && bundle.effects->kind == SharedEffectsKind::kArm;
  if (has_arm && options.has_smooth_remainder) {
    const SearchedModel all = AsProblem(calibration, options).model;
    Advice of_remainder = DiagnoseSmoothRemainder(Without(all.problem, all.judged.left_out), all.judged.solution);
    // A single arm has no name.
    for (Finding& finding : of_remainder.findings) {
      std::erase_if(finding.names, [](const auto& name) { return name.first == "of_arm"; });
    }
    append(of_remainder);
  }
  add(DiagnoseWeakDirections(solved, solution, bundle));
  add(DescribeModel(model, calibration.alternatives, solution));
  return advice;
}

}  // namespace heba
