#include "tools/run/earlier_run.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/data/joint_prior.h"
#include "solvers/calibration/prior_agreement.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns the place of a camera or target of the data set among those of the earlier run.
template <class Object>
std::optional<size_t> PlaceOf(const Object& object, size_t num_objects, const std::vector<Object>& earlier) {
  if (num_objects == 1 && earlier.size() == 1) return 0;
  for (size_t i = 0; i < earlier.size(); ++i) {
    if (earlier[i].name == object.name) return i;
  }
  return std::nullopt;
}

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

// Returns the parts of a camera, and of a target's shape, that the earlier run estimated.
std::vector<ParameterGroup> FreeIntrinsicsOf(const RunResult& earlier, size_t camera) {
  return GroupsIn<ParameterGroup>(earlier.solution.covariance.layout, CameraBlock(earlier.rig.cameras[camera]),
                                  [](int index) { return GroupOf(index); });
}
std::vector<TargetShapeGroup> FreeShapeOf(const RunResult& earlier, size_t target) {
  return GroupsIn<TargetShapeGroup>(earlier.solution.covariance.layout, TargetShapeBlock(earlier.rig.targets[target]),
                                    [](int index) { return ShapeGroupOf(index); });
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
  RobotNoisePrior prior{NoiseElsewhere(solution, 0), kLeastLogSigma};
  if (!(prior.median.translation_m > 0 && prior.median.rotation_rad > 0)) return std::nullopt;
  if (!solution.robot_noise_stddev.empty() && solution.robot_noise_stddev[0]) {
    const RobotNoise& stddev = *solution.robot_noise_stddev[0];
    prior.log_sigma = std::max({kLeastLogSigma, stddev.translation_m / prior.median.translation_m,
                                stddev.rotation_rad / prior.median.rotation_rad});
  }
  return prior;
}

}  // namespace

void BuildOn(const EarlierRun& earlier, PairDataset* dataset, PairRunOptions* options) {
  const RunResult& result = *earlier.result;
  if (result.rig.cameras.size() != 1 || result.rig.targets.size() != 1 || result.rig.robots.size() != 1) {
    throw InputError(earlier.name + ": is a run of several cameras, targets or arms, but the captures are of one each");
  }
  CheckTarget(earlier, *dataset->target, 0);
  BundleOptions& bundle = options->bundle;
  if (dataset->camera) {
    CheckCamera(earlier, *dataset->camera, result.solution.cameras[0]);
  } else {
    dataset->camera = result.solution.cameras[0];
    dataset->camera_source = earlier.name;
    bundle.free_intrinsics = FreeIntrinsicsOf(result, 0);
    options->choose_camera_model = false;
  }
  bundle.free_shape = FreeShapeOf(result, 0);
  options->choose.target_shape = false;
  // The prior has what the earlier run knew about the scale.
  bundle.target_scale_sigma = std::nullopt;
  Problem named = HandEyeProblem(dataset->setup, *dataset->camera, TargetShape());
  AddPrior(earlier, &named);
  bundle.prior = named.prior;
  const std::optional<RobotNoisePrior> noise = NoisePriorOf(result);
  if (!options->choose.robot_noise || options->joint_noise || !noise) return;
  options->choose.robot_noise = false;
  options->smooth = SmoothPoseErrors::kNone;
  bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  bundle.robot_noise_prior = noise;
  bundle.robot_noise_start = noise->median;
}

void BuildOn(const EarlierRun& earlier, Dataset* dataset, RunOptions* options) {
  const RunResult& result = *earlier.result;
  std::vector<ProblemCamera>& cameras = dataset->rig.cameras;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const std::optional<size_t> place = PlaceOf(cameras[c], cameras.size(), result.rig.cameras);
    if (!place) continue;
    if (dataset->has_camera[c]) {
      CheckCamera(earlier, cameras[c].camera, result.solution.cameras[*place]);
      continue;
    }
    cameras[c].camera = result.solution.cameras[*place];
    cameras[c].free_intrinsics = FreeIntrinsicsOf(result, *place);
    dataset->has_camera[c] = true;
    dataset->camera_sources[c] = earlier.name;
  }
  std::vector<ProblemTarget>& targets = dataset->rig.targets;
  for (size_t t = 0; t < targets.size(); ++t) {
    const std::optional<size_t> place = PlaceOf(targets[t], targets.size(), result.rig.targets);
    if (!place) continue;
    CheckTarget(earlier, *dataset->targets[t], *place);
    targets[t].free_shape = FreeShapeOf(result, *place);
    targets[t].scale_sigma = std::nullopt;
  }
  options->calibration.choose_target_shape = false;
}

void AddPrior(const EarlierRun& earlier, Problem* problem) {
  const RunResult& result = *earlier.result;
  for (ProblemTarget& target : problem->targets) {
    const std::optional<size_t> place = PlaceOf(target, problem->targets.size(), result.rig.targets);
    if (place) target.shape.params = result.solution.shapes[*place].params;
  }
  problem->prior = std::make_shared<const JointPrior>(JointPriorOf(result.rig, result.solution, *problem,
                                                                   earlier.change));
}

Finding JudgePrior(const EarlierRun& earlier, const Problem& used, const Solution& solution) {
  const double p_value = PriorPValue(used, solution);
  constexpr double kContradicts = 1e-4;
  Finding finding{p_value < kContradicts ? Grade::kBad : Grade::kGood, FindingCode("prior")};
  finding.numbers = {{"p", p_value}, {"unknowns", static_cast<double>(used.prior->covariance.layout.size())}};
  finding.names = {{"run", earlier.name}};
  finding.is_cause = finding.grade != Grade::kGood;
  return finding;
}

}  // namespace heba
