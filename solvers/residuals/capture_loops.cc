#include "solvers/residuals/capture_loops.h"

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "heba/base/error.h"
#include "solvers/residuals/repeated_poses.h"

namespace heba {
namespace {

// The indices of the shared poses: those of the cameras, of the targets, and of all bases but the first.
int CameraPose(size_t camera) { return static_cast<int>(camera); }
int PlaceOfTarget(const Problem& problem, size_t target) { return static_cast<int>(problem.cameras.size() + target); }
int BasePose(const Problem& problem, size_t robot) {
  return static_cast<int>(problem.cameras.size() + problem.targets.size() + robot) - 1;
}

// Makes the loop of every camera and target for the captures' poses of the arms.
class LoopMaker {
 public:
  LoopMaker(const Problem& problem, std::vector<size_t> moving, bool has_corrections)
      : problem_(problem), moving_(std::move(moving)), has_corrections_(has_corrections) {}

  KinematicLoop LoopOf(const ProblemCapture& capture, const ProblemImage& image) {
    const auto key = std::make_tuple(image.camera, image.target, EffectsOn(capture, image));
    auto found = patterns_.find(key);
    if (found == patterns_.end()) found = patterns_.emplace(key, PatternOf(capture, image)).first;
    std::vector<Rigid3d> known;
    std::vector<std::shared_ptr<const PoseEffect>> effects;
    for (const size_t robot : found->second.known) {
      known.push_back(capture.base_from_gripper[robot]);
      if (HasEffect(capture, robot)) effects.push_back(capture.effects[robot]);
    }
    return found->second.loop.With(std::move(known), std::move(effects));
  }

 private:
  struct Pattern {
    KinematicLoop loop;
    std::vector<size_t> known;  // The arms whose poses are the known factors.
  };

  bool HasEffect(const ProblemCapture& capture, size_t robot) const {
    return EffectsOf(problem_, robot) != nullptr && capture.effects[robot] != nullptr;
  }

  // Returns which of the two arms that carry camera and target have an effect.
  std::pair<bool, bool> EffectsOn(const ProblemCapture& capture, const ProblemImage& image) const {
    return {HasEffect(capture, problem_.cameras[image.camera].mount.robot),
            HasEffect(capture, problem_.targets[image.target].mount.robot)};
  }

  // Appends world_from_mount or, for two mounts on the bases of one arm, nothing.
  void Append(const ProblemCapture& capture, const Mount& mount, bool has_base, std::vector<LoopFactor>* factors,
              std::vector<size_t>* known) const {
    if (has_base && mount.robot > 0) factors->push_back(SharedFactor(BasePose(problem_, mount.robot)));
    if (mount.part == Mount::Part::kBase) return;
    factors->push_back(KnownFactor(Rigid3d()));
    known->push_back(mount.robot);
    if (HasEffect(capture, mount.robot)) {
      factors->push_back(EffectFactor(EffectsIndex(mount.robot), capture.effects[mount.robot]));
    }
    if (!has_corrections_) return;
    const auto place = std::find(moving_.begin(), moving_.end(), mount.robot);
    CHECK(place != moving_.end());
    factors->push_back(OwnFactor(static_cast<int>(place - moving_.begin())));
  }

  // Returns the index of an arm among those with effects.
  int EffectsIndex(size_t robot) const {
    int index = 0;
    for (size_t r = 0; r < robot; ++r) index += EffectsOf(problem_, r) != nullptr ? 1 : 0;
    return index;
  }

  Pattern PatternOf(const ProblemCapture& capture, const ProblemImage& image) const {
    const Mount& camera_mount = problem_.cameras[image.camera].mount;
    const Mount& target_mount = problem_.targets[image.target].mount;
    std::vector<LoopFactor> factors = {Inverse(SharedFactor(CameraPose(image.camera)))};
    std::vector<size_t> known;
    if (!(camera_mount == target_mount)) {
      const bool has_base = camera_mount.robot != target_mount.robot;
      std::vector<LoopFactor> to_camera;
      Append(capture, camera_mount, has_base, &to_camera, &known);
      std::reverse(to_camera.begin(), to_camera.end());
      for (LoopFactor& factor : to_camera) factors.push_back(Inverse(std::move(factor)));
      Append(capture, target_mount, has_base, &factors, &known);
    }
    factors.push_back(SharedFactor(PlaceOfTarget(problem_, image.target)));
    return {KinematicLoop(std::move(factors)), std::move(known)};
  }

  const Problem& problem_;
  std::vector<size_t> moving_;
  bool has_corrections_;
  std::map<std::tuple<size_t, size_t, std::pair<bool, bool>>, Pattern> patterns_;
};

LoopProblem WithoutCaptures(const Problem& problem, const FitNoise& noise) {
  LoopProblem loops;
  loops.layout = UnknownsOf(problem);
  for (const ProblemCamera& camera : problem.cameras) loops.cameras.push_back(&camera.camera.Model());
  for (const ProblemTarget& target : problem.targets) loops.targets.push_back(target.shape);
  loops.pixel_sigma_ratios = noise.pixel_px;
  return loops;
}

// Returns the directions in which the joints of an arm act on its pose at a capture; the joints of a capture without
// them are not noisy.
Matrix6X DirectionsOf(const ProblemCapture& capture, size_t robot, Eigen::Index num_joints) {
  if (capture.postures.empty() || capture.postures[robot].gripper_by_joints.cols() == 0) {
    return Matrix6X::Zero(6, num_joints);
  }
  return capture.postures[robot].gripper_by_joints;
}

// Makes the nuisance poses of captures: the corrections of the moving arms.
class NuisancePoseMaker {
 public:
  NuisancePoseMaker(const Problem& problem, const FitState& state, std::vector<size_t> moving)
      : problem_(problem), state_(state), moving_(std::move(moving)), num_joints_(NoisyJointsOf(problem, moving_)) {}

  // Returns the nuisance poses of a capture without priors.
  std::vector<NuisancePose> PosesOf(size_t capture) const {
    std::vector<NuisancePose> own;
    for (size_t k = 0; k < moving_.size(); ++k) {
      NuisancePose& pose = own.emplace_back();
      if (!state_.corrections.empty()) pose.pose = state_.corrections[capture][moving_[k]];
      if (num_joints_[k] > 0) pose.directions = DirectionsOf(problem_.captures[capture], moving_[k], num_joints_[k]);
    }
    return own;
  }

  // Likewise with the noise of the moving arms as their priors, which are appended to `priors`. Arms whose joints are
  // not noisy have one prior for all captures.
  std::vector<NuisancePose> PosesOf(size_t capture, const std::vector<RobotNoise>& noise,
                                    std::vector<Matrix6>* priors) {
    std::vector<NuisancePose> own = PosesOf(capture);
    common_.resize(own.size());
    for (size_t k = 0; k < own.size(); ++k) {
      std::optional<size_t>& common = common_[k];
      const bool is_common = num_joints_[k] == 0;
      if (!is_common || !common) {
        common = priors->size();
        priors->push_back(CorrectionPrior(noise[k], own[k].directions));
      }
      own[k].prior = common;
    }
    return own;
  }

 private:
  const Problem& problem_;
  const FitState& state_;
  std::vector<size_t> moving_;
  std::vector<Eigen::Index> num_joints_;
  std::vector<std::optional<size_t>> common_;  // The last prior of each arm.
};

bool HasPoints(const ProblemCapture& capture) {
  return std::any_of(capture.images.begin(), capture.images.end(),
                     [](const ProblemImage& image) { return image.observations.size() > 0; });
}

}  // namespace

std::vector<size_t> MovingRobots(const Problem& problem) {
  std::vector<size_t> moving;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const bool is_moving =
        std::any_of(problem.captures.begin(), problem.captures.end(), [&](const ProblemCapture& capture) {
          return std::any_of(capture.images.begin(), capture.images.end(), [&](const ProblemImage& image) {
            return image.observations.size() > 0 &&
                   IsMovedBy(problem.cameras[image.camera].mount, problem.targets[image.target].mount, r);
          });
        });
    if (is_moving) moving.push_back(r);
  }
  return moving;
}

std::vector<Eigen::Index> NoisyJointsOf(const Problem& problem, const std::vector<size_t>& moving) {
  std::vector<Eigen::Index> num_joints(moving.size(), 0);
  for (const ProblemCapture& capture : problem.captures) {
    for (size_t k = 0; k < moving.size() && !capture.postures.empty(); ++k) {
      num_joints[k] = std::max(num_joints[k], capture.postures[moving[k]].gripper_by_joints.cols());
    }
  }
  return num_joints;
}

std::vector<size_t> CapturesWithPoints(const Problem& problem) {
  std::vector<size_t> captures;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    if (HasPoints(problem.captures[i])) captures.push_back(i);
  }
  return captures;
}

CaptureGroups GroupByRobotPoses(const Problem& problem) {
  const std::vector<size_t> moving = MovingRobots(problem);
  const std::vector<size_t> captures = CapturesWithPoints(problem);
  std::vector<ReachedPoses> reached;
  for (const size_t i : captures) {
    const ProblemCapture& capture = problem.captures[i];
    ReachedPoses& of_capture = reached.emplace_back();
    for (const size_t r : moving) {
      const bool has_joints = !capture.postures.empty();
      of_capture.push_back(
          {capture.base_from_gripper[r], has_joints ? capture.postures[r].joints : std::vector<double>()});
    }
  }
  CaptureGroups groups = GroupPoses(reached);
  for (std::vector<size_t>& group : groups) {
    for (size_t& i : group) i = captures[i];
  }
  return groups;
}

std::vector<ImageIndex> ImagesOf(const Problem& problem, const CaptureGroups& groups) {
  std::vector<ImageIndex> images;
  for (const std::vector<size_t>& group : groups) {
    for (const size_t i : group) {
      for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
        if (problem.captures[i].images[k].observations.size() > 0) images.push_back({i, k});
      }
    }
  }
  return images;
}

double PoseErrorVariance(double sigma_px, double pixel_sigma_px, int num_points) {
  // The 2 n coordinates of the points have, in whitened units, the mean variance (sigma / pixel_sigma)^2. The error is
  // in as many directions as the pose has coordinates, or in all directions of a point or two.
  const int num_directions = std::min(6, 2 * num_points);
  const double ratio = sigma_px / pixel_sigma_px;
  return ratio * ratio * 2 * num_points / num_directions;
}

double PoseVarianceRatio(const FitNoise& noise, const ProblemImage& image) {
  return 1 + PoseErrorVariance(noise.image_px[image.camera], noise.pixel_px[image.camera], image.observations.size());
}

LoopProblem CaptureLoops(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                         const FitNoise& noise, bool has_corrections) {
  LoopProblem loops = WithoutCaptures(problem, noise);
  const std::vector<size_t> moving = MovingRobots(problem);
  LoopMaker maker(problem, moving, has_corrections);
  NuisancePoseMaker nuisance_poses(problem, state, moving);
  loops.captures.reserve(groups.size());
  for (const std::vector<size_t>& group : groups) {
    LoopCapture& capture = loops.captures.emplace_back();
    if (has_corrections) {
      capture.nuisance_poses = noise.robots.empty()
                                   ? nuisance_poses.PosesOf(group.front())
                                   : nuisance_poses.PosesOf(group.front(), noise.robots, &loops.priors);
    }
    for (const size_t i : group) {
      for (const ProblemImage& image : problem.captures[i].images) {
        if (image.observations.size() == 0) continue;
        capture.views.push_back({&image.observations, maker.LoopOf(problem.captures[i], image),
                                 static_cast<int>(image.camera), static_cast<int>(image.target),
                                 PoseVarianceRatio(noise, image)});
      }
    }
  }
  return loops;
}

LoopProblem ImageLoops(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                       const FitNoise& noise, const std::vector<size_t>& moving) {
  LoopProblem loops = WithoutCaptures(problem, noise);
  LoopMaker maker(problem, moving, true);
  const NuisancePoseMaker nuisance_poses(problem, state, moving);
  for (const ImageIndex& index : ImagesOf(problem, groups)) {
    const ProblemCapture& of_problem = problem.captures[index.capture];
    const ProblemImage& image = of_problem.images[index.image];
    LoopCapture& capture = loops.captures.emplace_back();
    capture.nuisance_poses = nuisance_poses.PosesOf(index.capture);
    capture.views.push_back({&image.observations, maker.LoopOf(of_problem, image), static_cast<int>(image.camera),
                             static_cast<int>(image.target), PoseVarianceRatio(noise, image)});
  }
  return loops;
}

LoopValues ValuesOf(const FitState& state) {
  LoopValues values;
  values.poses = state.poses.mount_from_camera;
  values.poses.insert(values.poses.end(), state.poses.mount_from_target.begin(), state.poses.mount_from_target.end());
  values.poses.insert(values.poses.end(), state.poses.world_from_base.begin() + 1, state.poses.world_from_base.end());
  for (const Camera& camera : state.cameras) values.cameras.push_back(camera.params);
  values.targets = state.shapes;
  for (const Eigen::VectorXd& effects : state.effects) {
    if (effects.size() > 0) values.effects.push_back(effects);
  }
  return values;
}

FitState WithValues(FitState state, const LoopValues& values) {
  auto pose = values.poses.begin();
  for (Rigid3d& camera : state.poses.mount_from_camera) camera = *pose++;
  for (Rigid3d& target : state.poses.mount_from_target) target = *pose++;
  for (size_t r = 1; r < state.poses.world_from_base.size(); ++r) state.poses.world_from_base[r] = *pose++;
  for (size_t c = 0; c < state.cameras.size(); ++c) state.cameras[c].params = values.cameras[c];
  state.shapes = values.targets;
  auto effects = values.effects.begin();
  for (Eigen::VectorXd& of_robot : state.effects) {
    if (of_robot.size() > 0) of_robot = *effects++;
  }
  return state;
}

Rigid3d PredictedPose(const Problem& problem, const FitState& state, const ImageIndex& index) {
  const ProblemCapture& capture = problem.captures[index.capture];
  const ProblemImage& image = capture.images[index.image];
  const std::vector<Rigid3d> none;
  const std::vector<Rigid3d>& corrections = state.corrections.empty() ? none : state.corrections[index.capture];
  return CameraFromTarget(problem, state.poses, image.camera, image.target,
                          Corrected(WithErrors(capture, state.effects), corrections));
}

}  // namespace heba
