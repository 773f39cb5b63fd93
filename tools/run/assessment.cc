#include "tools/run/assessment.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/calibration/residual_structure.h"
#include "solvers/calibration/scale_share.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/residuals/inliers.h"
#include "tools/run/captures.h"
#include "tools/run/reached_accuracy.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"
#include "tools/run/stand_in_arm.h"

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

ModelSummary SummariseModel(const PairCalibration& calibration) {
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

// Returns the entry of an image that is not used, without a reason.
ImageResult EntryOfUnused(const Dataset& dataset, size_t capture) {
  ImageResult image;
  image.capture = dataset.captures[capture].name;
  image.camera = dataset.rig.cameras.front().name;
  image.image = ImageOf(dataset, capture, 0);
  image.role = dataset.captures[capture].role;
  return image;
}

// Returns the entries of the images that were searched, in the order of `detections`.
std::vector<ImageResult> DescribeImages(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                        const PairCalibration& calibration,
                                        const std::vector<std::optional<CaptureMove>>& moves) {
  const PairSolution& solution = *calibration.refined;
  std::vector<ImageResult> results;
  std::map<size_t, size_t> place_of;
  for (const TargetDetection& seen : detections) {
    place_of[seen.capture] = results.size();
    ImageResult& result = results.emplace_back(EntryOfUnused(dataset, seen.capture));
    const Detection& detection = seen.detection.detection;
    result.reason = detection.reason;
    if (detection.ids.empty()) continue;
    TargetInImage& target = result.targets.emplace_back();
    target.target = dataset.rig.targets.front().name;
    target.num_points = static_cast<int>(detection.ids.size());
    target.num_second_pass = seen.detection.num_second_pass;
  }
  for (size_t v = 0; v < calibration.views.size(); ++v) {
    const View& view = calibration.views[v];
    ImageResult& result = results[place_of.at(view.capture)];
    TargetInImage& target = result.targets.front();
    result.used = true;
    target.used = true;
    const std::optional<SquaredErrors> errors = ViewErrors(
        solution.camera, CameraFromTarget(solution.hand_eye, CorrectedMount(SetupOf(dataset), view, solution)),
        ApplyShape(view.observations, solution.shape));
    if (errors) target.rms_px = errors->RmsPx();
    target.num_rejected = static_cast<int>(solution.views[v].rejected_ids.size());
    if (target.num_rejected > 0) {
      result.reason += std::string(result.reason.empty() ? "" : "; ") + std::to_string(target.num_rejected) +
                       (target.num_rejected == 1 ? " point is" : " points are") +
                       " rejected as inconsistent with the estimate from the others";
    }
    result.move_without = moves[v];
  }
  for (const UnusedView& unused : calibration.unused) results[place_of.at(unused.capture)].reason = unused.reason;
  return results;
}

// Returns the poses of the arm in all captures, with the corrections of those that the calibration uses.
std::vector<CapturePoses> PosesOfCaptures(const Dataset& dataset, const PairCalibration& calibration) {
  std::vector<CapturePoses> poses;
  for (const Recording& capture : dataset.captures) poses.push_back({capture.name, capture.base_from_gripper, {}});
  if (!calibration.refined) return poses;
  for (size_t v = 0; v < calibration.views.size(); ++v) {
    const std::optional<Rigid3d>& correction = calibration.refined->views[v].correction;
    if (correction) poses[calibration.views[v].capture].corrections = {*correction};
  }
  return poses;
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

Estimate RefinedEstimateOf(const std::string& method, const Outcome<PairSolution>& solution) {
  Estimate estimate = EstimateOf(method, EstimateKind::kRefined, solution);
  if (!solution) return estimate;
  estimate.solution = *solution;
  estimate.hand_eye = solution->hand_eye;
  return estimate;
}

// Returns the pairs with the errors of the robot that the solution has found.
std::vector<PosePair> CorrectedPairs(Setup setup, std::vector<PosePair> pairs, const PairSolution& solution) {
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

std::vector<Estimate> MakeEstimates(Setup setup, const PairCalibration& calibration,
                                    const std::vector<HoldOut>& hold_outs, const std::optional<Truth>& truth,
                                    const std::vector<Rigid3d>& symmetries) {
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

void AddHoldOuts(const Dataset& dataset, const std::vector<HoldOut>& hold_outs, std::string_view method,
                 std::vector<ImageResult>* images) {
  const auto of_method = std::find_if(hold_outs.begin(), hold_outs.end(),
                                      [&](const HoldOut& hold_out) { return hold_out.method == method; });
  if (of_method == hold_outs.end()) return;
  std::map<std::string, double> distance_m_of;
  for (const auto& [capture, distance_m] : of_method->target_m_of_capture) {
    distance_m_of[dataset.captures[capture].name] = distance_m;
  }
  for (ImageResult& image : *images) {
    const auto distance_m = distance_m_of.find(image.capture);
    if (distance_m != distance_m_of.end()) image.holdout_target_mm = 1000 * distance_m->second;
  }
}

// Returns the truth of the only camera and target; nothing if it is not known.
std::optional<Truth> TruthOf(const Dataset& dataset) {
  if (!dataset.truth) return std::nullopt;
  const CellTruth& truth = *dataset.truth;
  return Truth{truth.mount_from_camera.front(), truth.mount_from_target.front(), truth.cameras.front(), {}};
}

// Returns the result of a data set without estimates and captures.
RunResult ResultOf(const Dataset& dataset) {
  const Target* const target = dataset.targets.front().get();
  RunResult result = ShortResult(SetupOf(dataset), target != nullptr ? std::string(target->type()) : "",
                                 target != nullptr ? static_cast<int>(target->points().size()) : 0);
  result.name = dataset.name;
  result.about = dataset.about;
  return result;
}

}  // namespace

RunResult Assess(const Dataset& dataset, const RunOptions& run, const std::vector<TargetDetection>& detections,
                 const EffectsOfCaptures& effects, const PairCalibration& calibration, const Advice& advice,
                 PairCalibrationOptions options, RunObserver* observer) {
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
  result.estimates = MakeEstimates(options.setup, calibration, hold_outs, TruthOf(dataset), options.symmetries);
  const SearchedModel of_all = AsProblem(calibration, options).model;
  const Problem used = WithoutRejected(Without(of_all.problem, of_all.judged.left_out), of_all.judged.solution);
  const ScaleShare scales = ShareOfScales(used, of_all.judged.solution, ScaleSigmasOf(dataset, of_all.problem));
  const std::vector<Eigen::VectorXd> of_arm = ChangesByUnknownArms(used, of_all.judged.solution);
  AddShare(scales, advice.changes, of_arm, &*result.estimates.back().solution);
  result.observations.insert(result.observations.end(), scales.findings.begin(), scales.findings.end());
  ResidualStructure structure = FindResidualStructure(used, of_all.judged.solution);
  result.observations.insert(result.observations.end(), structure.findings.begin(), structure.findings.end());
  result.point_deviations = std::move(structure.points);
  if (!calibration.left_out.empty()) {
    SetLeftOut(ErrorsOfUnused(of_all.problem, of_all.judged.solution, of_all.judged.left_out, 0),
               &result.estimates.back().errors);
  }
  result.captures = PosesOfCaptures(dataset, calibration);
  result.images = DescribeImages(dataset, detections, calibration, MoveWithoutEachView(calibration, options));
  AddHoldOuts(dataset, hold_outs, kBundleMethod, &result.images);
  // A wrong scale moves the camera, and not what it sees of an object of known size.
  Solution solution = of_all.judged.solution;
  AddChanges(scales.changes, &solution.covariance);
  std::vector<Eigen::VectorXd> all_changes = advice.changes;
  all_changes.insert(all_changes.end(), of_arm.begin(), of_arm.end());
  result.working_points = WorkingPointsOf(used, solution, all_changes);
  result.model = SummariseModel(calibration);
  const PredictedImages predicted = PredictCaptures(dataset, detections, effects, *calibration.refined, 0);
  for (Finding& missing : FindMissingIds(dataset, detections, predicted)) {
    result.observations.push_back(std::move(missing));
  }
  for (Finding& turned : FindSeenFromBehind(dataset, detections, predicted)) {
    result.observations.push_back(std::move(turned));
  }
  result.requirements = ReachedAccuracies(run.requirements, used, solution, result.working_points);
  return WithFinalEstimate(std::move(result));
}

RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const PairCalibration& calibration,
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
  result.estimates = MakeEstimates(options.setup, calibration, hold_outs, TruthOf(dataset), {Rigid3d()});
  result.model = SummariseModel(calibration);
  result.captures = PosesOfCaptures(dataset, calibration);
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    result.images.push_back(EntryOfUnused(dataset, i));
    result.images.back().used = true;
  }
  AddHoldOuts(dataset, hold_outs, kChainMethod, &result.images);
  return WithFinalEstimate(std::move(result));
}

}  // namespace heba
