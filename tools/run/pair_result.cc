#include "tools/run/pair_result.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/units.h"
#include "solvers/calibration/held_out.h"
#include "solvers/initial/pose_selection.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/captures.h"
#include "tools/run/run_stage.h"

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

// Returns one estimate per method, then those of chain and bundle, each with its errors. `symmetries`: those of the
// target (Target::Symmetries).
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

// Returns the closed forms that succeeded on all captures; the folds run these.
std::vector<std::string> MethodsOf(const PairCalibration& calibration) {
  std::vector<std::string> methods;
  for (const MethodResult& method : calibration.methods) {
    if (method.hand_eye) methods.push_back(method.method);
  }
  return methods;
}

// Returns the held-out distances of a method, as those of the only camera.
std::vector<DistancesOfCaptures> DistancesOf(const std::vector<HoldOut>& hold_outs, std::string_view method) {
  for (const HoldOut& hold_out : hold_outs) {
    if (hold_out.method == method) return {hold_out.target_m_of_capture};
  }
  return {};
}

// Returns a problem whose parts have the names of those of `named`, and their state in the calibration.
Problem NamedProblem(Problem problem, const Problem& named, const PairCalibration& calibration) {
  problem.robots = named.robots;
  ProblemCamera& camera = problem.cameras.front();
  camera.name = named.cameras.front().name;
  camera.mount_name = named.cameras.front().mount_name;
  camera.free_intrinsics = calibration.bundle.free_intrinsics;
  camera.prior = calibration.bundle.camera_prior;
  ProblemTarget& target = problem.targets.front();
  target.name = named.targets.front().name;
  target.mount_name = named.targets.front().mount_name;
  target.free_shape = calibration.bundle.free_shape;
  return problem;
}

}  // namespace

FormOfResult PairForm(const ImageRun& run, const CalibratedImages& calibrated) {
  const Dataset& dataset = run.dataset;
  const PairCalibration& calibration = *calibrated.calibration.pairs.front().calibration;
  FormOfResult form;
  form.of_calibration = calibrated.findings;
  RunResult& result = form.result;
  result = ResultOf(dataset);
  PairCalibrationOptions options = *calibrated.pair_options;
  options.methods = MethodsOf(calibration);
  options.bundle.num_threads = 1;  // The folds run in parallel.
  std::vector<HoldOut> hold_outs;
  if (run.options.folds > 0) {
    const int num_folds = std::min(run.options.folds, static_cast<int>(calibration.views.size()));
    StageReport report(RunStage::kHoldOut, num_folds, run.observer);
    hold_outs = CrossValidate(calibration, options, num_folds, run.options.num_threads, [&] { report.Step(); });
  }
  if (run.observer != nullptr) run.observer->OnHoldOuts(hold_outs);
  form.held_out_m = DistancesOf(hold_outs, kBundleMethod);
  result.estimates = MakeEstimates(options.setup, calibration, hold_outs, TruthOf(dataset), options.symmetries);
  ImageSet contradicting;
  for (const View& view : calibration.left_out) contradicting.insert({view.capture, 0});
  if (!contradicting.empty()) {
    Errors& errors = result.estimates.back().errors;
    errors = WithLeftOut(errors, ErrorsOfUnused(calibrated.seen, *calibrated.calibration.refined, contradicting, 0));
  }
  result.model = SummariseModel(calibration);
  if (!dataset.arms.empty() && dataset.arms.front()) {
    ArmSummaries arm = SummariseOnlyArm(dataset, run.options.kinematics, calibrated.arms.front(), calibration);
    result.arms = std::move(arm.arms);
    form.of_arms = std::move(arm.findings);
  }
  return form;
}

RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const PairCalibration& calibration,
                      PoseCalibrationOptions options) {
  RunResult result = ResultOf(dataset);
  options.methods = MethodsOf(calibration);
  std::vector<HoldOut> hold_outs;
  if (run.folds > 0) {
    hold_outs =
        CrossValidatePoses(calibration, options, std::min(run.folds, static_cast<int>(calibration.pairs.size())));
  }
  result.estimates = MakeEstimates(options.setup, calibration, hold_outs, TruthOf(dataset), {Rigid3d()});
  result.model = SummariseModel(calibration);
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const Recording& capture = dataset.captures[i];
    result.captures.push_back({capture.name, capture.base_from_gripper, {}});
    ImageResult& image = result.images.emplace_back();
    image.capture = capture.name;
    image.camera = dataset.rig.cameras.front().name;
    image.image = ImageOf(dataset, i, 0);
    image.used = true;
  }
  result.images = WithHeldOutDistances(std::move(result.images), dataset, DistancesOf(hold_outs, kChainMethod));
  return WithFinalEstimate(std::move(result));
}

ArmSummaries SummariseOnlyArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                              const PairCalibration& calibration) {
  RobotSummary arm = SummariseArm(dataset, kinematics, setup, calibration);
  std::vector<Finding> findings = FindingsOf(arm, SetupOf(dataset), calibration);
  if (setup) {
    std::optional<Finding> singular = FindSingularCaptures(dataset, 0, *setup, arm.is_estimated);
    if (singular) findings.push_back(std::move(*singular));
  }
  return {{std::move(arm)}, std::move(findings)};
}

CalibratedPair AsPair(PairCalibration calibration) {
  CalibratedPair pair;
  pair.robot = 0;
  pair.num_images = static_cast<int>(calibration.views.size() + calibration.unused.size());
  pair.calibration = std::move(calibration);
  return pair;
}

RunOutput WithNames(RunOutput output) {
  Calibration& calibration = output.calibration;
  const PairCalibration& pair = *calibration.pairs.front().calibration;
  const Problem& named = output.dataset.rig;
  if (IsShort(named)) return output;
  calibration.problem = NamedProblem(std::move(calibration.problem), named, pair);
  calibration.refined->covariance.layout = UnknownsOf(calibration.problem);
  calibration.refined->covariance_repeatable.layout = calibration.refined->covariance.layout;
  CHECK_EQ(calibration.refined->covariance.layout.size(), calibration.refined->covariance.matrix.rows());
  RunResult& result = output.result;
  result.rig = NamedProblem(std::move(result.rig), named, pair);
  // A prior may have told the order in which the target is read; the truth does not know it.
  calibration.problem.targets.front().symmetries = output.dataset.targets.front()->Symmetries();
  result.rig.targets.front().symmetries = calibration.problem.targets.front().symmetries;
  // The basis of smooth errors is not written.
  const bool is_smooth =
      pair.refined->shared_effects != nullptr && pair.refined->shared_effects->kind == SharedEffectsKind::kSmooth;
  if (is_smooth) result.rig.effects.clear();
  result.solution = WithEffectsOf(result.rig, *calibration.refined);
  result.solution.captures.clear();
  return output;
}

}  // namespace heba
