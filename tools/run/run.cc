#include "heba/run.h"

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/stopwatch.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/verdict.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"
#include "tools/run/cell_result.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"
#include "tools/run/image_results.h"
#include "tools/run/image_run.h"
#include "tools/run/pose_run.h"
#include "tools/run/run_stage.h"

namespace heba {
namespace {

// Moves the captures in which the recorded joints of an arm contradict its pose to those that are left out.
Dataset WithoutWrongJoints(const Dataset& dataset) {
  std::map<size_t, std::string> reason_of;
  for (size_t r = 0; r < dataset.arms.size(); ++r) {
    const std::string& arm = dataset.rig.robots[r];
    for (const ContradictingJoints& joints : FindContradictingJoints(dataset, r)) {
      reason_of.try_emplace(joints.capture,
                            WhyLeftOut(joints, dataset.arms.size() == 1 ? "its joints" : "the joints of arm " + arm));
    }
  }
  return WithoutCaptures(dataset, reason_of);
}

// Throws InputError unless a capture has one entry for each arm and each camera.
void CheckCapture(const Dataset& dataset, const Recording& capture) {
  const size_t num_arms = dataset.rig.robots.size();
  if (!capture.joints.empty() && capture.joints.size() != num_arms) {
    throw InputError("capture " + capture.name + " needs a list of joints for each arm, or none");
  }
  if (capture.base_from_gripper.size() != num_arms || capture.images.size() != dataset.rig.cameras.size()) {
    throw InputError("capture " + capture.name + " needs one pose for each arm and one image for each camera");
  }
}

// Throws InputError if poses of the target were given and the data set is not complete without images.
void CheckTargetPoses(const Dataset& dataset, const RunOptions& options) {
  if (!IsSinglePair(dataset)) {
    throw InputError("poses of the target are for one camera and one target that one arm moves against each other");
  }
  if (dataset.target_poses.size() != dataset.captures.size()) {
    throw InputError("the data set has " + std::to_string(dataset.captures.size()) + " captures, but " +
                     std::to_string(dataset.target_poses.size()) + " poses of the target");
  }
  if (options.earlier) {
    throw InputError("the result of an earlier run is combined with images or points, not with poses of the target");
  }
}

// Throws InputError unless the poses of all captures can be taken from a robot's stream.
void CheckStream(const Dataset& dataset) {
  if (dataset.rig.robots.size() != 1) throw InputError("a stream of poses is for one arm");
  const std::vector<double>& times_s = dataset.stream->times_s;
  if (times_s.size() < 2 || times_s.size() != dataset.stream->base_from_gripper.size() ||
      std::adjacent_find(times_s.begin(), times_s.end(), std::greater_equal<>()) != times_s.end()) {
    throw InputError("a stream needs two poses or more, at increasing times");
  }
  for (const Recording& capture : dataset.captures) {
    if (!capture.time_s) throw InputError("capture " + capture.name + " needs a time, for the stream of poses");
  }
}

// Throws InputError unless every detection is one of an image of the data set.
void CheckDetections(const Dataset& dataset) {
  for (const TargetDetection& given : dataset.given_detections) {
    const bool is_known = given.capture < dataset.captures.size() && given.camera < dataset.rig.cameras.size() &&
                          given.target < dataset.targets.size();
    if (is_known && !dataset.captures[given.capture].images[given.camera].empty()) continue;
    throw InputError(dataset.detections_source + ": has a detection in an image that no capture has");
  }
}

// Throws InputError if the data set is incomplete.
void CheckDataset(const Dataset& dataset, const RunOptions& options) {
  const size_t num_cameras = dataset.rig.cameras.size();
  if (dataset.captures.empty()) throw InputError("the data set has no captures");
  if (num_cameras == 0 || dataset.targets.empty() || dataset.rig.robots.empty()) {
    throw InputError("a data set needs at least one camera, one target and one arm");
  }
  if (dataset.has_camera.size() != num_cameras || dataset.camera_sources.size() != num_cameras ||
      dataset.targets.size() != dataset.rig.targets.size()) {
    throw InputError("the lists of the data set differ in size from those of the rig");
  }
  const size_t num_arms = dataset.rig.robots.size();
  if (!dataset.arms.empty() && dataset.arms.size() != num_arms) {
    throw InputError("the kinematics of the arms differ in number from the arms");
  }
  if (!dataset.robot_scale_sigmas.empty() && dataset.robot_scale_sigmas.size() != num_arms) {
    throw InputError("the scales of the arms differ in number from the arms");
  }
  for (const Recording& capture : dataset.captures) CheckCapture(dataset, capture);
  if (dataset.stream) CheckStream(dataset);
  for (const PlacedRequirement& requirement : options.requirements) {
    const bool is_known = std::any_of(dataset.rig.cameras.begin(), dataset.rig.cameras.end(),
                                      [&](const ProblemCamera& camera) { return camera.name == requirement.camera; });
    if (!requirement.camera.empty() && !is_known) {
      throw InputError("there is no camera " + Quoted(requirement.camera) + " of which an accuracy is required");
    }
  }
  if (!dataset.target_poses.empty()) {
    CheckTargetPoses(dataset, options);
    return;
  }
  for (const std::shared_ptr<const Target>& target : dataset.targets) {
    if (target == nullptr) throw InputError("the data set has no target");
  }
  CheckDetections(dataset);
  TargetsWithFreePoints(dataset);
  const std::string faults = WhyNotToldApart(dataset);
  if (!faults.empty()) throw InputError(faults);
}

}  // namespace

std::string WhyNotToldApart(const Dataset& dataset) {
  std::map<std::string, size_t> target_of_code;
  for (size_t t = 0; t < dataset.targets.size(); ++t) {
    for (const std::string& code : dataset.targets[t]->Codes()) {
      const auto [other, is_new] = target_of_code.emplace(code, t);
      if (is_new) continue;
      return "targets " + dataset.rig.targets[other->second].name + " and " + dataset.rig.targets[t].name +
             " cannot be told apart in an image: both are recognised by " + code +
             "; print one of them with other codes or, if it has none, with another number of rows or columns";
    }
  }
  return "";
}

Dataset DatasetOf(Setup setup, std::shared_ptr<const Target> target, const std::optional<Camera>& camera) {
  Dataset dataset;
  dataset.rig = HandEyeProblem(setup, camera.value_or(Camera()), TargetShape());
  dataset.rig.cameras.front().free_intrinsics = BundleOptions().free_intrinsics;
  dataset.has_camera = {camera.has_value()};
  dataset.camera_sources = {"camera"};
  dataset.targets = {std::move(target)};
  return dataset;
}

Outcome<RunOutput> Run(const Dataset& dataset, const RunOptions& options_in, RunObserver* observer) {
  CheckDataset(dataset, options_in);
  const Stopwatch watch;
  try {
    RunOptions options = options_in;
    Dataset used = dataset;
    if (options.kinematics != Kinematics::kNone || options.joint_noise) used = WithoutWrongJoints(dataset);
    if (options.earlier) {
      BuiltOnEarlier built = BuildOn(*options_in.earlier, std::move(used), std::move(options));
      used = std::move(built.dataset);
      options = std::move(built.options);
    }
    Outcome<RunOutput> output =
        used.target_poses.empty() ? RunOnImages(used, options, observer) : RunOnPoses(used, options, observer);
    if (!output) return output;
    RunResult& result = output->result;
    for (ImageResult& left_out : LeftOutResults(output->dataset)) result.images.push_back(std::move(left_out));
    result.images = InOrderOfCaptures(std::move(result.images), dataset);
    result.verdict = JudgeRun(result);
    if (dataset.truth && !IsShort(result)) {
      result = WithTruth(std::move(result), *dataset.truth, output->calibration.problem);
    }
    result.timing.total_s = watch.Seconds();
    return output;
  } catch (const Cancelled&) {
    return Failure{FailureCode(kCancelled)};
  }
}

}  // namespace heba
