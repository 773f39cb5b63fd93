#include "tools/run/single_pair.h"

#include <map>
#include <string>
#include <utility>

#include "heba/data/hand_eye.h"
#include "heba/pair_run.h"

namespace heba {
namespace {

// Captures without an image are left out.
PairDataset DatasetOfPair(const Dataset& rig) {
  PairDataset dataset;
  std::map<size_t, size_t> place_of;  // The capture of the data set for that of the rig.
  const ProblemCamera& camera = rig.rig.cameras.front();
  dataset.name = rig.name;
  dataset.about = rig.about;
  dataset.setup = SetupOf(camera.mount);
  dataset.target = rig.targets.front();
  if (rig.has_camera.front()) dataset.camera = camera.camera;
  dataset.camera_source = rig.camera_sources.front();
  dataset.detections_source = rig.detections_source;
  if (!rig.arms.empty()) dataset.robot = rig.arms.front();
  if (!rig.robot_scale_sigmas.empty()) dataset.robot_scale_sigma = rig.robot_scale_sigmas.front();
  for (size_t i = 0; i < rig.captures.size(); ++i) {
    const Recording& recording = rig.captures[i];
    if (recording.images.front().empty()) continue;
    place_of[i] = dataset.captures.size();
    Capture& capture = dataset.captures.emplace_back();
    capture.name = recording.name;
    capture.image = recording.images.front();
    capture.base_from_gripper = recording.base_from_gripper.front();
    if (!recording.joints.empty()) capture.joints = recording.joints.front();
  }
  if (rig.given_detections.empty()) return dataset;
  dataset.given_detections.resize(dataset.captures.size());
  for (const TargetDetection& given : rig.given_detections) {
    const auto capture = place_of.find(given.capture);
    if (capture != place_of.end()) dataset.given_detections[capture->second] = given.detection;
  }
  return dataset;
}

// An estimated noise of the arm is one that is chosen from the captures, unless smooth errors are wanted beside it.
PairRunOptions OptionsOfPair(const Dataset& rig, const RunOptions& options) {
  const AdjustmentOptions& adjustment = options.calibration.adjustment;
  const ProblemCamera& camera = rig.rig.cameras.front();
  PairRunOptions of_pair;
  BundleOptions& bundle = of_pair.bundle;
  bundle.free_intrinsics = camera.free_intrinsics;
  bundle.camera_prior = camera.prior;
  bundle.free_shape = rig.rig.targets.front().free_shape;
  bundle.target_scale_sigma = rig.rig.targets.front().scale_sigma;
  bundle.loss = adjustment.loss;
  bundle.pixel_noise_px = adjustment.pixel_noise_px;
  bundle.robot = adjustment.robot;
  bundle.robot_noise = adjustment.robot_noise;
  bundle.robot_noise_prior = adjustment.robot_noise_prior;
  bundle.robot_noise_start = adjustment.robot_noise_start;
  bundle.effects_avoid_zero = adjustment.effects_avoid_zero;
  bundle.max_iterations = adjustment.max_iterations;
  of_pair.smooth = options.calibration.smooth;
  of_pair.choose.robot_noise =
      adjustment.robot == BundleOptions::Robot::kEstimatedNoise && of_pair.smooth != SmoothPoseErrors::kAlways;
  of_pair.choose.target_shape = options.calibration.choose_target_shape;
  of_pair.drift = options.drift;
  of_pair.earlier = options.earlier;
  of_pair.kinematics = options.kinematics;
  of_pair.camera_model = camera.camera.model;
  of_pair.choose_camera_model = !rig.has_camera.front() && of_pair.camera_model.empty();
  of_pair.folds = options.folds;
  of_pair.requirements = options.requirements;
  of_pair.num_threads = options.num_threads;
  if (!options.detect.empty()) of_pair.detect = options.detect.front();
  return of_pair;
}

// Gives the parts of a problem the names of those of `named`, and their state in the calibration.
void NameParts(const Problem& named, const PairCalibration& calibration, Problem* problem) {
  problem->robots = named.robots;
  ProblemCamera& camera = problem->cameras.front();
  camera.name = named.cameras.front().name;
  camera.mount_name = named.cameras.front().mount_name;
  camera.free_intrinsics = calibration.bundle.free_intrinsics;
  camera.prior = calibration.bundle.camera_prior;
  ProblemTarget& target = problem->targets.front();
  target.name = named.targets.front().name;
  target.mount_name = named.targets.front().mount_name;
  target.free_shape = calibration.bundle.free_shape;
  target.symmetries = named.targets.front().symmetries;
}

// Moves the captures of a problem and its solution to their places among those of the rig.
void PlaceCaptures(const Dataset& rig, const std::map<std::string, size_t>& place_of, RunOutput* output) {
  Problem& problem = output->calibration.problem;
  std::vector<ProblemCapture> captures;
  std::vector<CaptureOutcome> outcomes(rig.captures.size());
  std::vector<CapturePoses> results;
  for (const Recording& recording : rig.captures) {
    captures.push_back({recording.name, recording.base_from_gripper, {}});
    captures.back().effects.resize(rig.rig.robots.size());
    results.push_back({recording.name, recording.base_from_gripper, {}});
  }
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const size_t place = place_of.at(problem.captures[i].name);
    captures[place] = std::move(problem.captures[i]);
    outcomes[place] = std::move(output->calibration.refined->captures[i]);
    results[place].corrections = outcomes[place].corrections;
  }
  problem.captures = std::move(captures);
  output->calibration.refined->captures = std::move(outcomes);
  output->result.captures = std::move(results);
}

// Gives the parts and captures of a run the names and places that they have in the rig.
RunOutput PlacedInDataset(const Dataset& rig, RunOutput output) {
  const PairCalibration& of_pair = *output.calibration.pairs.front().calibration;
  std::map<std::string, size_t> place_of;
  for (size_t i = 0; i < rig.captures.size(); ++i) place_of[rig.captures[i].name] = i;
  for (TargetDetection& detection : output.detections) {
    detection.capture = place_of.at(output.dataset.captures[detection.capture].name);
  }
  PlaceCaptures(rig, place_of, &output);
  Calibration& calibration = output.calibration;
  Problem named = rig.rig;
  named.targets.front().symmetries = rig.targets.front()->Symmetries();
  NameParts(named, of_pair, &calibration.problem);
  calibration.refined->covariance.layout = UnknownsOf(calibration.problem);
  calibration.refined->covariance_repeatable.layout = calibration.refined->covariance.layout;
  CHECK_EQ(calibration.refined->covariance.layout.size(), calibration.refined->covariance.matrix.rows());

  RunResult& result = output.result;
  NameParts(named, of_pair, &result.rig);
  // The basis of smooth errors is not written.
  const bool is_smooth =
      of_pair.refined->shared_effects != nullptr && of_pair.refined->shared_effects->kind == SharedEffectsKind::kSmooth;
  if (is_smooth) result.rig.effects.clear();
  result.solution = WithEffectsOf(result.rig, *calibration.refined);
  result.solution.captures.clear();
  for (ImageResult& image : result.images) {
    image.camera = named.cameras.front().name;
    image.image = rig.captures[place_of.at(image.capture)].images.front().filename().string();
    for (TargetInImage& target : image.targets) target.target = named.targets.front().name;
  }
  return output;
}

}  // namespace

bool IsSinglePair(const Dataset& dataset) {
  const Problem& rig = dataset.rig;
  return rig.cameras.size() == 1 && rig.targets.size() == 1 && rig.robots.size() == 1 &&
         MovesAgainst(rig.cameras.front().mount, rig.targets.front().mount);
}

Outcome<RunOutput> RunSinglePair(const Dataset& dataset, const RunOptions& options, RunObserver* observer) {
  Outcome<RunOutput> run = Run(DatasetOfPair(dataset), OptionsOfPair(dataset, options), observer);
  if (!run) return run.failure();
  return PlacedInDataset(dataset, *std::move(run));
}

}  // namespace heba
