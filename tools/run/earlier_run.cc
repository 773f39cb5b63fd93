#include "tools/run/earlier_run.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/data/joint_prior.h"
#include "heba/data/same_object.h"
#include "heba/data/smooth_errors.h"
#include "heba/displaced_target.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/prior_agreement.h"
#include "solvers/uncertainty/robot_noise.h"
#include "tools/run/smooth_prior.h"

namespace heba {
namespace {

// Returns the groups of the unknowns of a block, in their order.
template <class Group, class GroupOf>
std::vector<Group> GroupsIn(const UnknownLayout& layout, const std::string& name, const GroupOf& group_of) {
  const UnknownBlock block = layout.Block(name);
  std::vector<Group> groups;
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    const Group group = group_of(layout[i].index);
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  return groups;
}

void CheckTarget(const EarlierRun& earlier, const Target& target, size_t place) {
  const std::vector<std::string>& types = earlier.result->target_types;
  if (place >= types.size() || types[place].empty() || types[place] == target.type()) return;
  throw InputError(earlier.name + ": is a run with a target of type " + types[place] + ", but the target is of type " +
                   std::string(target.type()));
}

void CheckCamera(const EarlierRun& earlier, const Camera& camera, const Camera& of_earlier) {
  if (camera.model != of_earlier.model) {
    throw InputError(earlier.name + ": is a run with the camera model " + of_earlier.model +
                     ", but that of the camera is " + camera.model);
  }
  if (camera.width_px <= 0 || (camera.width_px == of_earlier.width_px && camera.height_px == of_earlier.height_px)) {
    return;
  }
  throw InputError(earlier.name + ": is a run with images of " +
                   ImageSizeText(of_earlier.width_px, of_earlier.height_px) + ", but those of the camera are of " +
                   ImageSizeText(camera.width_px, camera.height_px));
}

// Returns the noise of the only arm as prior knowledge; nothing if the earlier run did not estimate it, or estimated
// the errors of the arm beside it.
std::optional<RobotNoisePrior> NoisePriorOf(const RunResult& earlier) {
  const Solution& solution = earlier.solution;
  if (earlier.rig.robots.size() != 1 || solution.robot_noise.empty() || !solution.robot_noise[0]) return std::nullopt;
  const SharedEffects* const effects = EffectsOf(earlier.rig, 0);
  if (effects != nullptr && effects->kind == SharedEffectsKind::kArm) return std::nullopt;
  constexpr double kLeastLogSigma = 0.1;
  constexpr double kUsualLogSigma = 0.25;  // That of some ten captures, if it is not known.
  RobotNoisePrior prior{NoiseElsewhere(solution, 0), kUsualLogSigma};
  if (!(prior.median.translation_m > 0 && prior.median.rotation_rad > 0)) return std::nullopt;
  if (!solution.robot_noise_stddev.empty() && solution.robot_noise_stddev[0]) {
    const RobotNoise& stddev = *solution.robot_noise_stddev[0];
    prior.log_sigma = std::max({kLeastLogSigma, stddev.translation_m / prior.median.translation_m,
                                stddev.rotation_rad / prior.median.rotation_rad});
  }
  return prior;
}

// Returns whether the earlier run knew all cameras, at the same mounts, and all arms: it then predicts each image.
bool SeesAsEarlier(const RunResult& earlier, const Problem& problem) {
  const bool has_same_arms = problem.robots.size() == earlier.rig.robots.size() &&
                             (problem.robots.size() == 1 || problem.robots == earlier.rig.robots);
  return has_same_arms && std::all_of(problem.cameras.begin(), problem.cameras.end(), [&](const ProblemCamera& camera) {
           const std::optional<size_t> place = PlaceOfSame(camera.name, problem.cameras.size(), earlier.rig.cameras);
           return place && earlier.rig.cameras[*place].mount == camera.mount;
         });
}

// A Sight is what the earlier run predicts of one image.
struct Sight {
  Camera camera;
  Rigid3d camera_from_target;
  TargetShape shape;
};

// Returns the prediction of a target in an image; nothing if the earlier run did not know its parts.
std::optional<Sight> SightOf(const EarlierRun& earlier, const Dataset& dataset, const TargetDetection& seen) {
  const RunResult& result = *earlier.result;
  const Problem& rig = dataset.rig;
  const std::optional<size_t> camera =
      PlaceOfSame(rig.cameras[seen.camera].name, rig.cameras.size(), result.rig.cameras);
  const std::optional<size_t> target =
      PlaceOfSame(rig.targets[seen.target].name, rig.targets.size(), result.rig.targets);
  if (!camera || !target) return std::nullopt;
  Sight sight{result.solution.cameras[*camera],
              CameraFromTarget(result.rig, result.solution.poses, *camera, *target,
                               dataset.captures[seen.capture].base_from_gripper),
              DesignedShape(AllPoints(*dataset.targets[seen.target]).points_in_target)};
  sight.shape.params = result.solution.shapes[*target].params;
  return sight;
}

// Returns the ids of the points in another order in which the target can be read.
std::vector<int> TurnedIds(const Target& target, const Rigid3d& symmetry, const std::vector<int>& ids) {
  const std::vector<TargetPoint>& points = target.points();
  std::map<int, int> turned;
  for (const TargetPoint& from : points) {
    const Eigen::Vector3d place = symmetry * from.in_target;
    const auto to = std::min_element(points.begin(), points.end(), [&](const TargetPoint& a, const TargetPoint& b) {
      return (a.in_target - place).squaredNorm() < (b.in_target - place).squaredNorm();
    });
    turned[from.id] = to->id;
  }
  std::vector<int> all;
  for (const int id : ids) all.push_back(turned.at(id));
  return all;
}

// Throws InputError unless an earlier run is one of the only camera, target and arm.
void CheckPair(const EarlierRun& earlier, const Dataset& dataset) {
  const RunResult& result = *earlier.result;
  if (result.rig.cameras.size() != 1 || result.rig.targets.size() != 1 || result.rig.robots.size() != 1) {
    throw InputError(earlier.name + ": is a run of several cameras, targets or arms, but the captures are of one each");
  }
  const Setup setup = SetupOf(result.rig.cameras[0].mount);
  const Setup of_captures = SetupOf(dataset.rig.cameras[0].mount);
  if (setup != of_captures) {
    throw InputError(earlier.name + ": is a run with the setup " + std::string(SetupName(setup)) +
                     ", but the captures are of " + std::string(SetupName(of_captures)));
  }
}

}  // namespace

std::vector<ParameterGroup> FreeIntrinsicsOf(const RunResult& earlier, size_t camera) {
  return GroupsIn<ParameterGroup>(earlier.solution.covariance.layout, CameraBlock(earlier.rig.cameras[camera]),
                                  [](int index) { return GroupOf(index); });
}

std::vector<TargetShapeGroup> FreeShapeOf(const RunResult& earlier, size_t target) {
  return GroupsIn<TargetShapeGroup>(earlier.solution.covariance.layout, TargetShapeBlock(earlier.rig.targets[target]),
                                    [](int index) { return ShapeGroupOf(index); });
}

BuiltOnEarlier BuildOn(const EarlierRun& earlier, Dataset dataset, RunOptions options) {
  const RunResult& result = *earlier.result;
  if (IsShort(dataset.rig)) CheckPair(earlier, dataset);
  std::vector<ProblemCamera>& cameras = dataset.rig.cameras;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const std::optional<size_t> place = PlaceOfSame(cameras[c].name, cameras.size(), result.rig.cameras);
    if (!place) continue;
    if (!FreeIntrinsicsOf(result, *place).empty()) cameras[c].prior = std::nullopt;
    const bool states_model = !cameras[c].camera.model.empty();
    if (states_model) CheckCamera(earlier, cameras[c].camera, result.solution.cameras[*place]);
    if (dataset.has_camera[c]) continue;
    cameras[c].camera = result.solution.cameras[*place];
    cameras[c].free_intrinsics = FreeIntrinsicsOf(result, *place);
    dataset.has_camera[c] = true;
    dataset.camera_sources[c] = earlier.name;
  }
  std::vector<ProblemTarget>& targets = dataset.rig.targets;
  bool knows_all_targets = true;
  for (size_t t = 0; t < targets.size(); ++t) {
    const std::optional<size_t> place = PlaceOfSame(targets[t].name, targets.size(), result.rig.targets);
    knows_all_targets = knows_all_targets && place.has_value();
    if (!place) continue;
    CheckTarget(earlier, *dataset.targets[t], *place);
    if (options.calibration.choose_target_shape) targets[t].free_shape = FreeShapeOf(result, *place);
    targets[t].scale_sigma = std::nullopt;
    if (*place < result.point_offsets.size()) {
      dataset.targets[t] = Displaced(dataset.targets[t], result.point_offsets[*place]);
    }
  }
  // Shapes are chosen for all targets or for none.
  if (knows_all_targets) options.calibration.choose_target_shape = false;
  const Problem named = WithPrior(dataset.rig, earlier);
  if (named.prior->covariance.layout.size() == 0) {
    throw InputError(earlier.name + ": is a run without a camera, target or arm of the same name and mount");
  }
  return {std::move(dataset), std::move(options)};
}

NoiseOfEarlier BuildNoiseOn(const EarlierRun& earlier, const Dataset& dataset, RunOptions options) {
  const RunResult& result = *earlier.result;
  AdjustmentOptions& adjustment = options.calibration.adjustment;
  SmoothPoseErrors& smooth = options.calibration.smooth;
  const bool is_chosen =
      adjustment.robot == BundleOptions::Robot::kEstimatedNoise && smooth != SmoothPoseErrors::kAlways;
  if (!is_chosen || options.joint_noise) return {std::move(options), std::nullopt};
  if (!result.solution.robot_noise.empty() && !result.solution.robot_noise[0]) {
    adjustment.robot = BundleOptions::Robot::kExact;
  }
  const std::optional<RobotNoisePrior> noise = NoisePriorOf(result);
  if (!noise) return {std::move(options), std::nullopt};
  const bool names_arm = !dataset.arms.empty() && dataset.arms[0] && options.kinematics != Kinematics::kNone;
  const bool takes_smooth = smooth != SmoothPoseErrors::kNone && !names_arm;
  smooth = SmoothPoseErrors::kNone;
  if (const std::optional<SmoothPrior> known = SmoothPriorsOf(result)[0]; known && takes_smooth) {
    adjustment.robot = BundleOptions::Robot::kGivenNoise;
    adjustment.robot_noise = *result.solution.robot_noise[0];
    std::vector<Rigid3d> poses;
    for (const Recording& capture : dataset.captures) poses.push_back(capture.base_from_gripper[0]);
    SmoothErrors errors(poses, known->lengths);
    errors.SetSigmas({known->sigma.translation_m, known->sigma.rotation_rad});
    return {std::move(options), std::move(errors)};
  }
  adjustment.robot_noise_prior = noise;
  adjustment.robot_noise_start = noise->median;
  return {std::move(options), std::nullopt};
}

std::vector<TargetDetection> ReadAsEarlier(const EarlierRun& earlier, const Dataset& dataset,
                                           std::vector<TargetDetection> detections) {
  if (earlier.change.is_target_moved || !SeesAsEarlier(*earlier.result, dataset.rig)) return detections;
  for (TargetDetection& seen : detections) {
    const Target& target = *dataset.targets[seen.target];
    const std::vector<Rigid3d> symmetries = target.Symmetries();
    Detection& detection = seen.detection.detection;
    const std::optional<Sight> sight = SightOf(earlier, dataset, seen);
    if (symmetries.size() < 2 || detection.ids.empty() || !sight) continue;
    Detection nearest = detection;
    double least_px = std::numeric_limits<double>::infinity();
    for (const Rigid3d& symmetry : symmetries) {
      Detection turned = detection;
      turned.ids = TurnedIds(target, symmetry, detection.ids);
      const std::optional<SquaredErrors> errors = ViewErrors(sight->camera, sight->camera_from_target,
                                                             ApplyShape(ObservationsOf(target, turned), sight->shape));
      const std::optional<double> rms_px = errors ? errors->RmsPx() : std::nullopt;
      if (!rms_px || *rms_px >= least_px) continue;
      least_px = *rms_px;
      nearest = std::move(turned);
    }
    detection = std::move(nearest);
  }
  return detections;
}

Problem WithPrior(Problem problem, const EarlierRun& earlier) {
  const RunResult& result = *earlier.result;
  ChangeOfCell change = earlier.change;
  const bool has_symmetry = std::any_of(problem.targets.begin(), problem.targets.end(),
                                        [](const ProblemTarget& target) { return target.symmetries.size() > 1; });
  // A target that is read in another order has another pose.
  if (has_symmetry && !SeesAsEarlier(result, problem)) change.is_target_moved = true;
  for (ProblemTarget& target : problem.targets) {
    const std::optional<size_t> place = PlaceOfSame(target.name, problem.targets.size(), result.rig.targets);
    if (!place) continue;
    target.shape.params = result.solution.shapes[*place].params;
    if (!change.is_target_moved) target.symmetries = {Rigid3d()};  // ReadAsEarlier
  }
  problem.prior = std::make_shared<const JointPrior>(JointPriorOf(result.rig, result.solution, problem, change));
  const Eigen::MatrixXd& covariance = problem.prior->covariance.matrix;
  const Eigen::VectorXd scales = covariance.diagonal().cwiseSqrt().cwiseInverse();
  if (!scales.allFinite() || !Cholesky(Eigen::MatrixXd(scales.asDiagonal() * covariance * scales.asDiagonal()))) {
    throw InputError(earlier.name + ": its covariance is not positive definite, and tells nothing for a later run");
  }
  return problem;
}

namespace {

// A Subject says what a block of unknowns is, and whose it is.
struct Subject {
  std::string part;
  std::string of;
};

Subject SubjectOf(const Problem& problem, const std::string& block) {
  for (const ProblemCamera& camera : problem.cameras) {
    if (block == CameraPoseBlock(camera)) return {"camera_pose", camera.name};
    if (block == CameraBlock(camera)) return {"lens", camera.name};
  }
  for (const ProblemTarget& target : problem.targets) {
    if (block == TargetPoseBlock(target)) return {"target_pose", target.name};
    if (block == TargetShapeBlock(target)) return {"target_shape", target.name};
  }
  for (const std::string& robot : problem.robots) {
    if (block == BaseBlock(robot)) return {"base", robot};
  }
  return {};
}

// Returns whether a difference is more than chance. Every lens and print has errors that its model lacks, which differ
// from one set of captures to another; a lens that was refocused or exchanged differs by more.
bool Contradicts(const PriorAgreement& agreement) {
  constexpr double kByChance = 1e-4;
  constexpr double kUnmodelled = 5;
  return agreement.p_value < kByChance && (agreement.is_of_poses || agreement.ratio > kUnmodelled);
}

// Returns the code of what is wrong with an earlier run, beside that it knows too little, or "arm" if it estimated
// errors of an arm, which the captures have, too, and which are not corrected; empty if nothing is wrong.
std::string FaultOf(const RunResult& earlier, const Problem& used) {
  constexpr std::string_view kKnowsLittle[] = {"uncertainty", "required", "weak_direction", "few_captures",
                                               "captures_left_out"};
  for (const Finding& finding : earlier.verdict.findings) {
    if (finding.grade == Grade::kBad &&
        std::find(std::begin(kKnowsLittle), std::end(kKnowsLittle), finding.code) == std::end(kKnowsLittle)) {
      return finding.code;
    }
  }
  const auto has_arm_errors = [](const Problem& problem) {
    return std::any_of(problem.effects.begin(), problem.effects.end(), [](const auto& effects) {
      return effects != nullptr && effects->kind == SharedEffectsKind::kArm;
    });
  };
  if (has_arm_errors(earlier.rig) && !has_arm_errors(used)) return "arm";
  return "";
}

}  // namespace

Finding JudgePrior(const EarlierRun& earlier, const Problem& used, const Solution& solution) {
  // Small probabilities are rounded to zero.
  const auto rank = [](const PriorAgreement& one) { return std::tuple(Contradicts(one), -one.p_value, one.ratio); };
  const std::vector<PriorAgreement> all = AgreementWithPrior(used, solution);
  const auto least = std::max_element(
      all.begin(), all.end(), [&](const PriorAgreement& a, const PriorAgreement& b) { return rank(a) < rank(b); });
  CHECK(least != all.end());
  Finding finding{Contradicts(*least) ? Grade::kBad : Grade::kGood, FindingCode("prior")};
  const std::string fault = FaultOf(*earlier.result, used);
  if (!fault.empty()) finding.grade = std::max(finding.grade, Grade::kDoubtful);
  const Subject subject = SubjectOf(used, least->block);
  finding.numbers = {{"p", least->p_value}, {"ratio", least->ratio}};
  finding.names = {{"run", earlier.name}, {"part", subject.part}};
  if (!subject.of.empty()) finding.names.emplace_back("of", subject.of);
  if (!fault.empty()) finding.names.emplace_back("fault", fault);
  finding.is_cause = finding.grade != Grade::kGood;
  return finding;
}

}  // namespace heba
