// Cross-validation of a calibration from poses of the target.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/pair_cross_validation.h"
#include "solvers/residuals/repeated_poses.h"

namespace heba {
namespace {

// The errors of a method on the pairs that were held out.
struct HeldOutPoses {
  double sum_m2 = 0;
  double sum_rad2 = 0;
  std::vector<std::pair<size_t, double>> distance_m_of_capture;
  Failure reason;  // The first failure.

  void Add(const Rigid3d& predicted, const Rigid3d& seen, size_t capture) {
    const double distance_m = (predicted.translation - seen.translation).norm();
    sum_m2 += distance_m * distance_m;
    sum_rad2 += std::pow(AngleRad(predicted, seen), 2);
    distance_m_of_capture.emplace_back(capture, distance_m);
  }
  void Fail(int fold, const Failure& why) {
    if (reason.empty()) reason = {FailureCode("of_fold"), {{"fold", fold + 1}}, {}, {why}};
  }
};

HoldOut HoldOutOf(const std::string& method, HeldOutPoses errors) {
  HoldOut result;
  result.method = method;
  result.reason = errors.reason;
  if (!errors.reason.empty() || errors.distance_m_of_capture.empty()) return result;
  const auto num = static_cast<double>(errors.distance_m_of_capture.size());
  result.target_m = std::sqrt(errors.sum_m2 / num);
  result.target_rad = std::sqrt(errors.sum_rad2 / num);
  result.target_m_of_capture = std::move(errors.distance_m_of_capture);
  return result;
}

}  // namespace

std::vector<HoldOut> CrossValidatePoses(const PairCalibration& full, const PoseCalibrationOptions& options,
                                        int num_folds) {
  PoseCalibrationOptions fold_options = options;
  fold_options.effects.clear();
  if (full.bundle.effects != nullptr) fold_options.effects = {full.bundle.effects};
  fold_options.must_have_effects = full.bundle.effects != nullptr;
  std::vector<int> fold_of(full.pairs.size());
  int num_poses = 0;
  for (const std::vector<size_t>& group : GroupByRobotPose(options.setup, full.pairs)) {
    for (const size_t i : group) fold_of[i] = num_poses % num_folds;
    ++num_poses;
  }
  std::map<std::string, HeldOutPoses> errors;
  for (int fold = 0; fold < num_folds; ++fold) {
    std::vector<PosePair> rest;
    std::vector<size_t> held_out;
    for (size_t i = 0; i < full.pairs.size(); ++i) {
      if (fold_of[i] == fold) {
        held_out.push_back(i);
      } else {
        rest.push_back(full.pairs[i]);
      }
    }
    const PairCalibration part = CalibratePoses(std::move(rest), fold_options);
    // Predicts the poses that were held out, with the errors of the robot that `solution` has found.
    const auto predict = [&](const std::string& method, const Outcome<HandEye>& hand_eye,
                             const PairSolution& solution) {
      HeldOutPoses& of_method = errors[method];
      if (!hand_eye) of_method.Fail(fold, hand_eye.failure());
      for (size_t k = 0; hand_eye && k < held_out.size(); ++k) {
        const PosePair& pair = full.pairs[held_out[k]];
        const Rigid3d mount =
            CorrectedMount(options.setup, pair.camera_mount_from_target_mount, pair.effect.get(), solution);
        of_method.Add(CameraFromTarget(*hand_eye, mount), pair.camera_from_target, held_out[k]);
      }
    };
    for (const MethodResult& method : part.methods) predict(method.method, method.hand_eye, PairSolution());
    if (part.chain) {
      predict(kChainMethod, part.chain->hand_eye, *part.chain);
    } else {
      predict(kChainMethod, part.chain.failure(), PairSolution());
    }
  }
  std::vector<HoldOut> results;
  for (auto& [method, of_method] : errors) results.push_back(HoldOutOf(method, std::move(of_method)));
  return results;
}

}  // namespace heba
