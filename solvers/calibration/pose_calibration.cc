// Calibration from poses of the target that others estimated.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/even_indices.h"
#include "heba/base/failure_code.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/closed_form_results.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/calibration/posture_choice.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/refine/pose_refinement.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// A model of the robot's errors, fitted to the pairs.
struct FittedChain {
  ErrorModel model;
  PairSolution solution;
  double log_likelihood = 0;
};

// Returns the closed form from which the refinement starts: the one with the smallest scatter of the target in the
// frame in which it is fixed, because there are no pixels to compare. Null if none has a result.
const MethodResult* FindStart(const std::vector<MethodResult>& results, const std::string& seed,
                              const std::vector<PosePair>& pairs) {
  const MethodResult* best = nullptr;
  double least_mm = std::numeric_limits<double>::infinity();
  for (const MethodResult& result : results) {
    if (!result.hand_eye || (seed != kBestSeed && result.method != seed)) continue;
    const std::optional<BoardScatter> scatter = ComputeBoardScatter(pairs, *result.hand_eye);
    if (!scatter || scatter->translation_rms_mm >= least_mm) continue;
    least_mm = scatter->translation_rms_mm;
    best = &result;
  }
  return best;
}

Failure WhyNoStart(const std::vector<MethodResult>& results, const std::string& seed) {
  Failure last = FailureCode("no_closed_form");
  for (const MethodResult& result : results) {
    const bool counts =
        seed == kBestSeed ? FindHandEyeMethod(result.method)->motion == MethodMotion::kAny : result.method == seed;
    if (counts && !result.hand_eye) last = result.hand_eye.failure();
  }
  return last;
}

// The refinement with the chosen errors, and the models among which was chosen.
struct ChosenChain {
  FittedChain fitted;
  std::vector<ModelAlternative> alternatives;
};

// Refines with the noise of the robot and the simplest systematic errors that the pairs do not reject.
Outcome<ChosenChain> RefineWithChosenErrors(const PoseCalibrationOptions& options, const std::vector<PosePair>& pairs,
                                            const HandEye& start) {
  std::vector<std::shared_ptr<const SharedEffects>> candidates = {nullptr};
  candidates.insert(candidates.end(), options.effects.begin(), options.effects.end());
  if (options.must_have_effects) candidates = {options.effects.back()};
  std::vector<FittedChain> fitted;
  Failure last;
  for (const std::shared_ptr<const SharedEffects>& effects : candidates) {
    const Outcome<PairSolution> solution = RefineChainWithNoise(options.setup, pairs, start, effects);
    if (!solution) {
      last = solution.failure();
      continue;
    }
    fitted.push_back({{BundleOptions::Robot::kEstimatedNoise, {}, effects},
                      *solution,
                      ChainLogLikelihoodOf(options.setup, pairs, *solution)});
  }
  if (fitted.empty()) return last;
  const FittedChain& largest = fitted.back();
  const FittedChain* chosen = nullptr;
  std::vector<ModelAlternative> alternatives;
  for (const FittedChain& smaller : fitted) {
    ModelAlternative alternative{smaller.model, smaller.log_likelihood, smaller.solution.robot_noise,
                                 NumVariances(smaller.model), std::nullopt};
    if (&smaller != &largest) {
      alternative.p = PValueOfRatio(smaller.log_likelihood, largest.log_likelihood,
                                    {0, NumVariances(largest.model) - NumVariances(smaller.model)},
                                    largest.solution.covariance_dof);
      alternative.odds = OddsAgainst(largest.model, alternative, [&](const SharedEffects& effects) {
        return ChainLogLikelihoodAtLeast(options.setup, pairs, largest.solution, effects);
      });
    }
    if (chosen == nullptr && IsAcceptable(alternative, largest.model)) chosen = &smaller;
    if (candidates.size() > 1) alternatives.push_back(std::move(alternative));
  }
  CHECK(chosen != nullptr) << "the largest model cannot be rejected";
  return ChosenChain{*chosen, std::move(alternatives)};
}

}  // namespace

PairCalibration CalibratePoses(std::vector<PosePair> pairs, const PoseCalibrationOptions& options) {
  CHECK(options.has_robot_noise || options.effects.empty());
  PairCalibration calibration;
  calibration.pairs = std::move(pairs);
  const std::vector<MethodResult> results = RunMethods(calibration);
  calibration.methods = Reported(results, options.methods);
  calibration.refined = Failure{FailureCode("no_pixels")};
  const MethodResult* const start = FindStart(results, options.seed, calibration.pairs);
  if (start == nullptr) {
    calibration.chain = WhyNoStart(results, options.seed);
    return calibration;
  }
  calibration.seed = start->method;
  if (!options.has_robot_noise) {
    calibration.chain = RefineChain(calibration.pairs, *start->hand_eye);
    return calibration;
  }
  Outcome<ChosenChain> chosen = RefineWithChosenErrors(options, calibration.pairs, *start->hand_eye);
  if (!chosen) {
    calibration.chain = chosen.failure();
    return calibration;
  }
  calibration.bundle.robot = chosen->fitted.model.robot;
  calibration.bundle.effects = chosen->fitted.model.effects;
  calibration.chain = std::move(chosen->fitted.solution);
  calibration.alternatives = std::move(chosen->alternatives);
  return calibration;
}

std::optional<std::vector<size_t>> MostLikelyBranchesOfPairs(Setup setup, const std::vector<PosePair>& pairs,
                                                             const HandEye& start, const ArmErrorModels& arm) {
  const auto fit = [&](const std::vector<size_t>& branches) -> std::optional<FittedPostures<PairSolution>> {
    std::vector<PosePair> with_errors = pairs;
    for (size_t i = 0; i < pairs.size(); ++i) with_errors[i].effect = arm.effects_of_captures[branches[i]][i];
    Outcome<PairSolution> solution = RefineChainWithNoise(setup, with_errors, start, ErrorsOfBranches(arm));
    if (!solution) return std::nullopt;
    const double log_likelihood = ChainLogLikelihoodOf(setup, with_errors, *solution);
    return FittedPostures<PairSolution>{std::move(*solution), log_likelihood};
  };
  PosturesOfCaptures postures = PosturesByErrors(arm, EvenIndices(pairs.size(), pairs.size()));
  const auto choose = [&](const PairSolution& at) -> std::optional<std::vector<size_t>> {
    postures.views = LinearisePairs(setup, pairs, at);
    postures.variances = CorrectionVariances(*at.robot_noise);
    return ChoosePostures(postures);
  };
  std::optional<PairSolution> at;
  if (Outcome<PairSolution> without = RefineChainWithNoise(setup, pairs, start, nullptr)) at = std::move(*without);
  return MostProbableBranches(arm, pairs.size(), std::move(at), fit, choose);
}

}  // namespace heba
