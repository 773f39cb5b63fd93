#include "tools/run/assessment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"
#include "heba/data/stated_pose.h"
#include "heba/target_location.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/usable_views.h"
#include "tools/run/captures.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

// Computes the errors that every estimate is measured by.
Errors EvaluateEstimate(const HandEye& hand_eye, const Camera& camera, const std::vector<View>& views,
                        const std::vector<PosePair>& pairs, const std::optional<Truth>& truth,
                        const std::vector<Rigid3d>& symmetries) {
  Errors errors;
  const std::optional<SquaredErrors> squared = ReprojectionErrors(hand_eye, camera, views);
  if (squared) errors.reprojection_rms_px = squared->RmsPx();
  errors.axxb_mean_mm = AxxbMeanMm(pairs, hand_eye.camera_mount_from_camera);
  errors.board_scatter = ComputeBoardScatter(pairs, hand_eye);
  if (truth) errors.truth = CompareWithTruth(hand_eye, camera, *truth, symmetries);
  return errors;
}

// Returns the working point: that of the capture with the median distance. Returns nothing if its points do not
// determine the target's pose. What a wrong held part does to the camera and to what the camera sees cancels in part:
// a located target moves by as much as the target of the calibration (`changes`, as of Advice).
std::optional<WorkingPoint> FindWorkingPoint(const Calibration& calibration, Setup setup,
                                             const std::vector<Eigen::VectorXd>& changes) {
  const Solution& solution = *calibration.refined;
  std::vector<std::pair<double, const View*>> by_distance;
  const auto middle_of = [&](const View& view) -> Eigen::Vector3d {
    return CameraFromTarget(solution.hand_eye, CorrectedMount(setup, view, solution)) *
           ApplyShape(view.observations, solution.shape).points_in_target.rowwise().mean();
  };
  for (const View& view : calibration.views) {
    if (view.observations.size() >= kMinPosePoints) by_distance.emplace_back(middle_of(view).norm(), &view);
  }
  if (by_distance.empty()) return std::nullopt;
  const auto middle = by_distance.begin() + static_cast<std::ptrdiff_t>(by_distance.size() / 2);
  std::nth_element(by_distance.begin(), middle, by_distance.end());
  const View& view = *middle->second;
  const StatedPose camera_mount = setup == Setup::kEyeInHand ? GripperPoseOf(setup, view) : StatedPose();
  const Outcome<LocatedTarget> located = LocateTarget(setup, solution, view.observations, camera_mount);
  if (!located) return std::nullopt;
  const Eigen::Matrix3d base_from_camera = Correct(solution, camera_mount).base_from_mount.RotationMatrix() *
                                           solution.hand_eye.camera_mount_from_camera.RotationMatrix();
  WorkingPoint point{middle_of(view),
                     base_from_camera.transpose() * located->covariance.by_calibration_m2 * base_from_camera};
  const Eigen::Matrix3d camera_from_target =
      CameraFromTarget(solution.hand_eye, CorrectedMount(setup, view, solution)).RotationMatrix();
  const Eigen::Index first = solution.covariance.layout.Block(kBoardBlock).first;
  for (const Eigen::VectorXd& change : changes) {
    const Eigen::Vector3d in_camera = camera_from_target * change.segment<3>(first);
    point.covariance_m2 += in_camera * in_camera.transpose();
  }
  return point;
}

ModelSummary SummariseModel(const Calibration& calibration) {
  ModelSummary model;
  const BundleOptions& bundle = calibration.bundle;
  constexpr const char* kRobotNames[] = {"none", "given", "estimated"};
  model.robot_noise = kRobotNames[static_cast<size_t>(bundle.robot)];
  for (const TargetShapeGroup group : bundle.free_shape) {
    model.target_shape.emplace_back(kTargetShapeGroupNames[static_cast<size_t>(group)]);
  }
  if (calibration.refined) model.camera = calibration.refined->camera.model;
  for (const ModelAlternative& alternative : calibration.alternatives) {
    model.alternatives.push_back(
        {NameOf(alternative.model), alternative.log_likelihood, alternative.dof, alternative.p, alternative.odds});
  }
  for (const CameraAlternative& alternative : calibration.camera_alternatives) {
    model.alternatives.push_back({"camera " + alternative.model, alternative.log_likelihood, alternative.dof,
                                  alternative.p, std::nullopt, alternative.reason});
  }
  return model;
}

// Returns the accuracy that the calibration reaches at each position for which the config requires one. A camera that
// the robot carries can see a target at any position as at the working point.
std::vector<Requirement> ReachedRequirements(const Dataset& dataset, const std::vector<PlacedRequirement>& requirements,
                                             const Calibration& calibration, const RunResult& result) {
  std::vector<Requirement> reached;
  const Solution& solution = *calibration.refined;
  for (const PlacedRequirement& required : requirements) {
    Requirement entry{required.within_m, required.confidence, "the working point"};
    const auto radius_m = [&](const Eigen::Matrix3d& covariance_m2) {
      return ConfidenceRadius(covariance_m2, required.confidence, solution.covariance_dof);
    };
    if (result.working_point) entry.reached_m = radius_m(result.working_point->covariance_m2);
    if (!required.places_in_base_m.empty() && dataset.setup == Setup::kEyeToHand) {
      entry.place = required.text;
      entry.reached_m = 0;
      const View& fullest =
          *std::max_element(calibration.views.begin(), calibration.views.end(),
                            [](const View& a, const View& b) { return a.observations.size() < b.observations.size(); });
      for (const Eigen::Vector3d& place : required.places_in_base_m) {
        // The target as that capture showed it, moved to the position.
        Observations seen = fullest.observations;
        Rigid3d camera_from_target =
            CameraFromTarget(solution.hand_eye, CorrectedMount(dataset.setup, fullest, solution));
        const Eigen::Vector3d middle = seen.points_in_target.rowwise().mean();
        camera_from_target.translation +=
            Inverse(solution.hand_eye.camera_mount_from_camera) * place - camera_from_target * middle;
        const bool is_in_view = Predict(solution.camera.Model(), solution.camera.params.data(), camera_from_target,
                                        ApplyShape(seen, solution.shape), &seen.pixels, nullptr);
        const Outcome<LocatedTarget> located =
            is_in_view ? LocateTarget(dataset.setup, solution, seen, Rigid3d()) : Outcome<LocatedTarget>();
        if (!located) {
          entry.reached_m.reset();
          entry.unreached = is_in_view ? Unreached::kUndetermined : Unreached::kNotInView;
          break;
        }
        entry.reached_m = std::max(*entry.reached_m, radius_m(located->covariance.by_calibration_m2));
      }
    }
    reached.push_back(std::move(entry));
  }
  return reached;
}

std::vector<CaptureResult> DescribeCaptures(const Dataset& dataset, const std::vector<CaptureDetection>& detections,
                                            const Calibration& calibration,
                                            const std::vector<std::optional<CaptureMove>>& moves) {
  const Solution& solution = *calibration.refined;
  std::vector<CaptureResult> results;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    CaptureResult result;
    result.image = dataset.captures[i].name;
    result.role = dataset.captures[i].role;
    result.num_points = static_cast<int>(detections[i].detection.ids.size());
    result.num_second_pass = detections[i].num_second_pass;
    result.reason = detections[i].detection.reason;
    results.push_back(std::move(result));
  }
  for (size_t v = 0; v < calibration.views.size(); ++v) {
    const View& view = calibration.views[v];
    CaptureResult& result = results[view.capture];
    result.used = true;
    const std::optional<SquaredErrors> errors =
        ViewErrors(solution.camera, CameraFromTarget(solution.hand_eye, CorrectedMount(dataset.setup, view, solution)),
                   ApplyShape(view.observations, solution.shape));
    if (errors) result.rms_px = errors->RmsPx();
    const ViewOutcome& outcome = solution.views[v];
    result.num_rejected = static_cast<int>(outcome.rejected_ids.size());
    if (result.num_rejected > 0) {
      result.reason += std::string(result.reason.empty() ? "" : "; ") + std::to_string(result.num_rejected) +
                       (result.num_rejected == 1 ? " point is" : " points are") +
                       " rejected as inconsistent with the estimate from the others";
    }
    result.correction = outcome.correction;
    result.move_without = moves[v];
  }
  for (const UnusedView& unused : calibration.unused) results[unused.capture].reason = unused.reason;
  for (const LeftOut& entry : dataset.left_out) {
    CaptureResult result;
    result.image = entry.name;
    result.reason = entry.reason;
    result.was_searched = false;
    results.push_back(std::move(result));
  }
  return results;
}

template <typename T>
Estimate EstimateOf(const std::string& method, EstimateKind kind, const Outcome<T>& outcome) {
  Estimate estimate;
  estimate.method = method;
  estimate.kind = kind;
  estimate.ok = outcome.ok();
  if (!outcome) estimate.reason = outcome.failure();
  return estimate;
}

Estimate RefinedEstimateOf(const std::string& method, const Outcome<Solution>& solution) {
  Estimate estimate = EstimateOf(method, EstimateKind::kRefined, solution);
  if (!solution) return estimate;
  estimate.solution = *solution;
  estimate.hand_eye = solution->hand_eye;
  return estimate;
}

// Returns the pairs with the errors of the robot that the solution has found.
std::vector<PosePair> CorrectedPairs(Setup setup, std::vector<PosePair> pairs, const Solution& solution) {
  for (PosePair& pair : pairs) {
    pair.camera_mount_from_target_mount =
        CorrectedMount(setup, pair.camera_mount_from_target_mount, pair.effect.get(), solution);
    pair.effect = nullptr;
  }
  return pairs;
}

// Returns the probability that a method that predicts the target no better than another one does so much better in the
// captures that both have held out, by Student's paired test of the logarithms of the distances; nothing if there are
// fewer than three captures.
std::optional<double> PValueOfBetter(const HoldOut& of_method, const HoldOut& of_other) {
  const std::map<size_t, double> others_m(of_other.target_m_of_capture.begin(), of_other.target_m_of_capture.end());
  std::vector<double> gains;
  for (const auto& [capture, distance_m] : of_method.target_m_of_capture) {
    const auto other = others_m.find(capture);
    if (other == others_m.end() || distance_m <= 0 || other->second <= 0) continue;
    gains.push_back(std::log(other->second / distance_m));
  }
  constexpr size_t kFewest = 3;
  if (gains.size() < kFewest) return std::nullopt;
  const auto count = static_cast<double>(gains.size());
  double mean = 0;
  double squares = 0;
  for (const double gain : gains) mean += gain / count;
  for (const double gain : gains) squares += (gain - mean) * (gain - mean);
  if (squares <= 0) return std::nullopt;
  const double of_either = 0.5 * FisherTail(mean * mean * count * (count - 1) / squares, 1, count - 1);
  return mean > 0 ? of_either : 1 - of_either;
}

}  // namespace

std::vector<Estimate> MakeEstimates(Setup setup, const Calibration& calibration, const std::vector<HoldOut>& hold_outs,
                                    const std::optional<Truth>& truth, const std::vector<Rigid3d>& symmetries) {
  std::vector<Estimate> estimates;
  const auto evaluate = [&](const Estimate& estimate) {
    return EvaluateEstimate(estimate.hand_eye, estimate.camera, calibration.views, calibration.pairs, truth,
                            symmetries);
  };
  for (const MethodResult& method : calibration.methods) {
    Estimate& estimate = estimates.emplace_back(EstimateOf(method.method, EstimateKind::kClosedForm, method.hand_eye));
    estimate.camera = calibration.camera;
    if (!estimate.ok) continue;
    estimate.hand_eye = *method.hand_eye;
    estimate.errors = evaluate(estimate);
  }
  Estimate& chain = estimates.emplace_back(RefinedEstimateOf(kChainMethod, calibration.chain));
  chain.camera = calibration.camera;
  if (chain.ok) {
    chain.errors = EvaluateEstimate(chain.hand_eye, chain.camera, calibration.views,
                                    CorrectedPairs(setup, calibration.pairs, *chain.solution), truth, symmetries);
  }
  Estimate& refined = estimates.emplace_back(RefinedEstimateOf(kBundleMethod, calibration.refined));
  if (refined.ok) {
    refined.camera = refined.solution->camera;
    // The refined camera sees other target poses than the camera that the closed forms used.
    const std::vector<View> shaped =
        ApplyShape(CorrectedViews(setup, calibration.views, *refined.solution), refined.solution->shape);
    refined.errors = EvaluateEstimate(refined.hand_eye, refined.camera, shaped,
                                      PosePairsOf(refined.camera, refined.hand_eye, shaped), truth, symmetries);
  }
  const auto of_refined = std::find_if(hold_outs.begin(), hold_outs.end(),
                                       [](const HoldOut& hold_out) { return hold_out.method == kBundleMethod; });
  for (Estimate& estimate : estimates) {
    for (const HoldOut& hold_out : hold_outs) {
      if (hold_out.method != estimate.method) continue;
      estimate.errors.holdout_rms_px = hold_out.rms_px;
      if (hold_out.target_m) estimate.errors.holdout_target_mm = 1000 * *hold_out.target_m;
      if (hold_out.target_rad) estimate.errors.holdout_target_deg = RadToDeg(*hold_out.target_rad);
      estimate.errors.holdout_chi2 = hold_out.chi2_per_dof;
      estimate.errors.holdout_sigmas = hold_out.sigmas;
      if (of_refined != hold_outs.end()) estimate.errors.holdout_better_p = PValueOfBetter(hold_out, *of_refined);
    }
  }
  return estimates;
}

namespace {

void AddHoldOuts(const std::vector<HoldOut>& hold_outs, std::string_view method, std::vector<CaptureResult>* captures) {
  for (const HoldOut& hold_out : hold_outs) {
    if (hold_out.method != method) continue;
    for (const auto& distance_of : hold_out.target_m_of_capture) {
      (*captures)[distance_of.first].holdout_target_mm = 1000 * distance_of.second;
    }
  }
}

// Returns the result of a data set without estimates and captures.
RunResult ResultOf(const Dataset& dataset) {
  RunResult result;
  result.name = dataset.name;
  result.about = dataset.about;
  result.setup = dataset.setup;
  result.target_type = dataset.target ? dataset.target->type() : "";
  result.num_target_points = dataset.target ? static_cast<int>(dataset.target->points().size()) : 0;
  return result;
}

}  // namespace

RunResult Assess(const Dataset& dataset, const RunOptions& run, const std::vector<CaptureDetection>& detections,
                 const Calibration& calibration, const Advice& advice, CalibrationOptions options,
                 RunObserver* observer) {
  RunResult result = ResultOf(dataset);
  result.observations = advice.findings;
  // The folds run the methods that succeeded on all captures.
  options.methods.clear();
  for (const MethodResult& method : calibration.methods) {
    if (method.hand_eye) options.methods.push_back(method.method);
  }
  options.bundle.num_threads = 1;  // The folds run in parallel.
  std::vector<HoldOut> hold_outs;
  if (run.folds > 0) {
    const int num_folds = std::min(run.folds, static_cast<int>(calibration.views.size()));
    StageReport report(RunStage::kHoldOut, num_folds, observer);
    hold_outs = CrossValidate(calibration, options, num_folds, run.num_threads, [&] { report.Step(); });
  }
  if (observer != nullptr) observer->OnHoldOuts(hold_outs);
  result.estimates = MakeEstimates(dataset.setup, calibration, hold_outs, dataset.truth, options.symmetries);
  AddChanges(advice.changes, &result.estimates.back().solution->covariance);
  if (!calibration.left_out.empty()) {
    const SearchedModel of_all = AsProblem(calibration, options).model;
    SetLeftOut(ErrorsOfUnused(of_all.problem, of_all.judged.solution, of_all.judged.left_out, 0),
               &result.estimates.back().errors);
  }
  result.captures = DescribeCaptures(dataset, detections, calibration, MoveWithoutEachView(calibration, options));
  AddHoldOuts(hold_outs, kBundleMethod, &result.captures);
  result.working_point = FindWorkingPoint(calibration, dataset.setup, advice.changes);
  result.model = SummariseModel(calibration);
  for (Finding& missing :
       FindMissingIds(AsRigDataset(dataset), InRig(detections), PredictCaptures(dataset, *calibration.refined, 0))) {
    result.observations.push_back(std::move(missing));
  }
  result.requirements = ReachedRequirements(dataset, run.requirements, calibration, result);
  return result;
}

RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const Calibration& calibration,
                      PoseCalibrationOptions options) {
  RunResult result = ResultOf(dataset);
  // The folds run the methods that succeeded on all captures.
  options.methods.clear();
  for (const MethodResult& method : calibration.methods) {
    if (method.hand_eye) options.methods.push_back(method.method);
  }
  std::vector<HoldOut> hold_outs;
  if (run.folds > 0) {
    hold_outs =
        CrossValidatePoses(calibration, options, std::min(run.folds, static_cast<int>(calibration.pairs.size())));
  }
  result.estimates = MakeEstimates(dataset.setup, calibration, hold_outs, dataset.truth, {Rigid3d()});
  result.model = SummariseModel(calibration);
  for (const Capture& capture : dataset.captures) {
    CaptureResult described;
    described.image = capture.name;
    described.role = capture.role;
    described.used = true;
    result.captures.push_back(std::move(described));
  }
  AddHoldOuts(hold_outs, kChainMethod, &result.captures);
  return result;
}

}  // namespace heba
