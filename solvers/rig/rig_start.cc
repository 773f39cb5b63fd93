#include "solvers/rig/rig_start.h"

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/target_pose.h"

namespace heba {
namespace {

// The rigid bodies of a rig: what is fixed on the bases, and each gripper with what it carries.
constexpr size_t kWorldBody = 0;

// A camera, target or base, or the origin of a body: the first base, or a gripper.
struct Node {
  enum class Kind { kOrigin, kCamera, kTarget, kBase };
  Kind kind = Kind::kOrigin;
  size_t index = 0;  // For an origin, the body.
  auto operator<=>(const Node& other) const = default;
};

Node BaseNode(size_t robot) {
  return robot == 0 ? Node{Node::Kind::kOrigin, kWorldBody} : Node{Node::Kind::kBase, robot};
}
Node GripperNode(size_t robot) { return {Node::Kind::kOrigin, 1 + robot}; }

// A relative pose within a body.
struct Edge {
  Node parent;
  Node child;
  Rigid3d parent_from_child;
  double variance_m2 = 0;  // Of a point half a metre away, for comparison with other edges.
};

double VarianceM2(const Matrix6& covariance) {
  constexpr double kLeverM = 0.5;
  return covariance.topLeftCorner<3, 3>().trace() + kLeverM * kLeverM * covariance.bottomRightCorner<3, 3>().trace();
}

// Returns the images of a pair as views. Their mounts' pose is that of a hand-eye calibration with `robot`, if it is
// set.
std::vector<View> ViewsOf(const RigProblem& problem, size_t camera, size_t target, std::optional<size_t> robot) {
  std::vector<View> views;
  const bool is_in_hand = problem.cameras[camera].mount.part == Mount::Part::kGripper;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const RigCapture& capture = problem.captures[i];
    for (const RigImage& image : capture.images) {
      if (image.camera != camera || image.target != target || image.observations.size() == 0) continue;
      View& view = views.emplace_back();
      view.name = capture.name;
      view.capture = i;
      view.observations = image.observations;
      if (robot) {
        view.camera_mount_from_target_mount = CameraMountFromTargetMount(
            is_in_hand ? Setup::kEyeInHand : Setup::kEyeToHand, capture.base_from_gripper[*robot]);
      }
    }
  }
  return views;
}

// Returns the edges that a calibrated pair gives, or the pose of the target in the best image of a pair at rest.
std::vector<Edge> EdgesOf(const RigProblem& problem, const RigPair& pair) {
  const Mount& camera_mount = problem.cameras[pair.camera].mount;
  const Mount& target_mount = problem.targets[pair.target].mount;
  const Node camera{Node::Kind::kCamera, pair.camera};
  const Node target{Node::Kind::kTarget, pair.target};
  if (pair.robot) {
    if (!pair.calibration || !pair.calibration->refined) return {};
    const Solution& solution = *pair.calibration->refined;
    const bool is_in_hand = camera_mount.part == Mount::Part::kGripper;
    const Node base = BaseNode(*pair.robot);
    const Node gripper = GripperNode(*pair.robot);
    return {{is_in_hand ? gripper : base, camera, solution.hand_eye.camera_mount_from_camera,
             VarianceM2(*PoseCovarianceOf(solution.covariance, kHandEyeBlock))},
            {is_in_hand ? base : gripper, target, solution.hand_eye.target_mount_from_target,
             VarianceM2(*PoseCovarianceOf(solution.covariance, kBoardBlock))}};
  }
  if (MovesAgainst(camera_mount, target_mount)) return {};
  std::optional<TargetPose> best;
  for (const View& view : ViewsOf(problem, pair.camera, pair.target, std::nullopt)) {
    for (const TargetPose& pose : EstimateTargetPose(problem.cameras[pair.camera].camera, view.observations)) {
      if (pose.covariance_at_1px && (!best || pose.rms_px < best->rms_px)) best = pose;
    }
  }
  if (!best) return {};
  return {{camera, target, best->camera_from_target, VarianceM2(*best->covariance_at_1px)}};
}

// Names the nodes, each in words.
std::string NamesOf(const RigProblem& problem, const std::vector<Node>& nodes) {
  std::vector<std::string> names;
  for (const Node& node : nodes) {
    if (node.kind == Node::Kind::kCamera) names.push_back("camera " + problem.cameras[node.index].name);
    if (node.kind == Node::Kind::kTarget) names.push_back("target " + problem.targets[node.index].name);
    if (node.kind == Node::Kind::kBase) names.push_back("arm " + problem.robots[node.index]);
  }
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

Failure WhyNotJoined(const RigProblem& problem, const std::vector<RigPair>& pairs, const std::vector<Node>& missing) {
  const auto is_missing = [&](Node::Kind kind, size_t index) {
    return std::find(missing.begin(), missing.end(), Node{kind, index}) != missing.end();
  };
  // The reason of a pair that would have joined one of them comes first.
  for (const RigPair& pair : pairs) {
    if (!is_missing(Node::Kind::kCamera, pair.camera) && !is_missing(Node::Kind::kTarget, pair.target)) continue;
    const std::string names = "camera " + problem.cameras[pair.camera].name + " and target " +
                              problem.targets[pair.target].name + " (" + std::to_string(pair.num_images) + " images)";
    const auto failed = [&](const std::string& reason) {
      return Failure{names + " could not be calibrated, and no other images join them to the rest: " + reason};
    };
    if (!pair.robot && MovesAgainst(problem.cameras[pair.camera].mount, problem.targets[pair.target].mount)) {
      return failed("they are on two arms; each needs images with something else, for example a fixed target");
    }
    if (pair.robot && !pair.calibration) return failed(pair.calibration.reason());
    if (pair.robot && !pair.calibration->refined) return failed(pair.calibration->refined.reason());
  }
  const bool is_one = missing.size() == 1;
  return Failure{NamesOf(problem, missing) + (is_one ? " shares" : " share") + " no target and no arm with the others" +
                 (is_one ? "" : ": no image joins them to the rest")};
}

}  // namespace

Outcome<std::vector<Camera>> EstimateRigCameras(const RigProblem& problem, const RigCalibrationOptions& options) {
  std::vector<Camera> cameras;
  std::vector<std::string> reasons(problem.cameras.size());
  for (const RigCamera& camera : problem.cameras) cameras.push_back(camera.camera);
  ParallelFor(static_cast<int>(cameras.size()), options.adjustment.num_threads, [&](int index) {
    const auto c = static_cast<size_t>(index);
    if (!options.has_camera.empty() && options.has_camera[c]) return;
    std::vector<View> views;
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      for (View& view : ViewsOf(problem, c, t, std::nullopt)) views.push_back(std::move(view));
    }
    const Camera& known = problem.cameras[c].camera;
    if (known.model.empty()) {
      Outcome<CameraChoice> choice = ChooseCameraModel(views, known.width_px, known.height_px);
      if (choice) cameras[c] = choice->camera;
      if (!choice) reasons[c] = choice.reason();
    } else {
      Outcome<Camera> camera = EstimateIntrinsics(views, known.model, known.width_px, known.height_px);
      if (camera) cameras[c] = *camera;
      if (!camera) reasons[c] = camera.reason();
    }
  });
  for (size_t c = 0; c < reasons.size(); ++c) {
    if (!reasons[c].empty()) return Failure{"camera " + problem.cameras[c].name + ": " + reasons[c]};
  }
  return cameras;
}

std::vector<RigPair> CalibratePairs(const RigProblem& problem, const RigCalibrationOptions& options) {
  std::vector<RigPair> pairs;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      RigPair pair{c, t, std::nullopt};
      std::vector<size_t> movers;
      for (size_t r = 0; r < problem.robots.size(); ++r) {
        if (IsMovedBy(problem.cameras[c].mount, problem.targets[t].mount, r)) movers.push_back(r);
      }
      if (movers.size() == 1) pair.robot = movers.front();
      pair.num_images = static_cast<int>(ViewsOf(problem, c, t, std::nullopt).size());
      if (pair.num_images > 0) pairs.push_back(std::move(pair));
    }
  }
  ParallelFor(static_cast<int>(pairs.size()), options.adjustment.num_threads, [&](int index) {
    RigPair& pair = pairs[static_cast<size_t>(index)];
    if (!pair.robot) return;
    const RigCamera& camera = problem.cameras[pair.camera];
    const RigTarget& target = problem.targets[pair.target];
    CalibrationOptions single;
    single.setup = camera.mount.part == Mount::Part::kGripper ? Setup::kEyeInHand : Setup::kEyeToHand;
    single.camera = camera.camera;
    single.shape = target.shape;
    single.symmetries = target.symmetries;
    single.choose = {};
    single.bundle.free_intrinsics = camera.free_intrinsics;
    single.bundle.loss = options.adjustment.loss;
    const std::vector<View> views = ViewsOf(problem, pair.camera, pair.target, pair.robot);
    pair.calibration = Calibrate(views, single);
    if (pair.calibration && pair.calibration->refined) return;
    // The images of one target may be too few to determine the camera.
    single.bundle.free_intrinsics.clear();
    Outcome<Calibration> held = Calibrate(views, single);
    if (held && held->refined) pair.calibration = std::move(held);
  });
  return pairs;
}

Outcome<RigPoses> JoinPairs(const RigProblem& problem, const std::vector<RigPair>& pairs) {
  std::vector<Edge> edges;
  for (const RigPair& pair : pairs) {
    for (Edge& edge : EdgesOf(problem, pair)) edges.push_back(std::move(edge));
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& a, const Edge& b) { return a.variance_m2 < b.variance_m2; });
  // The pose of each node in its body.
  std::map<Node, Rigid3d> body_from;
  for (size_t body = 0; body <= problem.robots.size(); ++body) body_from[{Node::Kind::kOrigin, body}] = Rigid3d();
  for (size_t next = 0; next < edges.size();) {
    const Edge& edge = edges[next++];
    const bool has_parent = body_from.contains(edge.parent);
    const bool has_child = body_from.contains(edge.child);
    if (has_parent == has_child) continue;
    if (has_parent) {
      body_from[edge.child] = body_from[edge.parent] * edge.parent_from_child;
    } else {
      body_from[edge.parent] = body_from[edge.child] * Inverse(edge.parent_from_child);
    }
    next = 0;  // The best edge that the larger tree allows is next.
  }
  std::vector<Node> missing;
  const auto require = [&](const Node& node) {
    if (!body_from.contains(node)) missing.push_back(node);
  };
  for (size_t c = 0; c < problem.cameras.size(); ++c) require({Node::Kind::kCamera, c});
  for (size_t t = 0; t < problem.targets.size(); ++t) require({Node::Kind::kTarget, t});
  for (size_t r = 1; r < problem.robots.size(); ++r) require(BaseNode(r));
  if (!missing.empty()) return WhyNotJoined(problem, pairs, missing);

  RigPoses poses;
  for (size_t r = 0; r < problem.robots.size(); ++r) poses.world_from_base.push_back(body_from[BaseNode(r)]);
  const auto mount_from = [&](const Mount& mount, const Node& node) {
    if (mount.part == Mount::Part::kGripper) return body_from[node];
    return Inverse(poses.world_from_base[mount.robot]) * body_from[node];
  };
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    poses.mount_from_camera.push_back(mount_from(problem.cameras[c].mount, {Node::Kind::kCamera, c}));
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    poses.mount_from_target.push_back(mount_from(problem.targets[t].mount, {Node::Kind::kTarget, t}));
  }
  return poses;
}

void ChooseReadingOrders(const RigPoses& poses, RigProblem* problem) {
  for (RigCapture& capture : problem->captures) {
    for (RigImage& image : capture.images) {
      const std::vector<Rigid3d>& symmetries = problem->targets[image.target].symmetries;
      if (symmetries.size() < 2 || image.observations.size() == 0) continue;
      const Rigid3d predicted =
          CameraFromTarget(*problem, poses, image.camera, image.target, capture.base_from_gripper);
      Points3 best = image.observations.points_in_target;
      double least_px2 = std::numeric_limits<double>::infinity();
      for (const Rigid3d& symmetry : symmetries) {
        Observations read = image.observations;
        read.points_in_target =
            ((symmetry.RotationMatrix() * image.observations.points_in_target).colwise() + symmetry.translation).eval();
        const std::optional<SquaredErrors> errors = ViewErrors(problem->cameras[image.camera].camera, predicted, read);
        if (!errors || errors->sum_px2 >= least_px2) continue;
        least_px2 = errors->sum_px2;
        best = read.points_in_target;
      }
      image.observations.points_in_target = std::move(best);
    }
  }
}

}  // namespace heba
