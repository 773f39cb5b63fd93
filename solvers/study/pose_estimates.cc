#include "solvers/study/pose_estimates.h"

#include <algorithm>
#include <utility>

#include "heba/calibration.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/uncertainty_limits.h"

namespace heba {
namespace {

// Calibrates captures whose arms have white noise alone.
Outcome<Calibration> CalibrateAsKnown(const StudyCell& cell, Problem problem) {
  CalibrationOptions options;
  options.adjustment = cell.options.bundle;
  options.choose_target_shape = cell.options.choose.target_shape;
  options.smooth = SmoothPoseErrors::kNone;
  if (cell.gives_cameras) options.has_camera.assign(problem.cameras.size(), true);
  for (ProblemCamera& camera : problem.cameras) {
    if (!cell.gives_cameras) camera.camera.params.clear();
  }
  return Calibrate(problem, options);
}

// A camera by itself.
struct SingleCamera {
  Problem problem;
  std::vector<size_t> robots;  // The indices of its arms in the rig.
  Mount mount;                 // The mount, in the rig, to which the camera's pose refers.
};

// Returns a camera with the targets that it sees and the arms that move these against it. Everything at rest is on the
// base of the first of these arms unless its own base is among them. Returns nothing if no arm moves a target that the
// camera sees.
std::optional<SingleCamera> OnlyCamera(const Problem& problem, size_t camera) {
  std::vector<bool> is_seen(problem.targets.size());
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.camera == camera) is_seen[image.target] = true;
    }
  }
  SingleCamera single;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    bool is_needed = false;
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      is_needed = is_needed || (is_seen[t] && IsMovedBy(problem.cameras[camera].mount, problem.targets[t].mount, r));
    }
    if (!is_needed) continue;
    single.robots.push_back(r);
    single.problem.robots.push_back(problem.robots[r]);
  }
  if (single.robots.empty()) return std::nullopt;
  const auto place_of = [&](const Mount& mount) {
    const auto found = std::find(single.robots.begin(), single.robots.end(), mount.robot);
    const bool is_kept = found != single.robots.end();
    CHECK(is_kept || mount.part == Mount::Part::kBase);
    return Mount{is_kept ? static_cast<size_t>(found - single.robots.begin()) : 0, mount.part};
  };
  single.problem.cameras = {problem.cameras[camera]};
  single.problem.cameras[0].mount = place_of(problem.cameras[camera].mount);
  single.mount = {single.robots[single.problem.cameras[0].mount.robot], problem.cameras[camera].mount.part};
  std::vector<size_t> places(problem.targets.size());
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (!is_seen[t]) continue;
    places[t] = single.problem.targets.size();
    single.problem.targets.push_back(problem.targets[t]);
    single.problem.targets.back().mount = place_of(problem.targets[t].mount);
  }
  for (const ProblemCapture& capture : problem.captures) {
    ProblemCapture& kept = single.problem.captures.emplace_back();
    kept.name = capture.name;
    for (const size_t r : single.robots) kept.base_from_gripper.push_back(capture.base_from_gripper[r]);
    for (const ProblemImage& image : capture.images) {
      if (image.camera == camera) kept.images.push_back({0, places[image.target], image.observations});
    }
  }
  return single;
}

// Returns the pose of a camera in another one, from two independent poses in one mount.
PoseEstimate Between(const PoseEstimate& mount_from_a, const PoseEstimate& mount_from_b) {
  PoseByUnknowns a{mount_from_a.pose, Matrix6X::Zero(6, 12)};
  PoseByUnknowns b{mount_from_b.pose, Matrix6X::Zero(6, 12)};
  a.by_unknowns.leftCols<6>().setIdentity();
  b.by_unknowns.rightCols<6>().setIdentity();
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  covariance.topLeftCorner<6, 6>() = mount_from_a.covariance;
  covariance.bottomRightCorner<6, 6>() = mount_from_b.covariance;
  const PoseByUnknowns a_from_b = Inverse(a) * b;
  return {"", a_from_b.pose, a_from_b.by_unknowns * covariance * a_from_b.by_unknowns.transpose(),
          std::min(mount_from_a.dof, mount_from_b.dof)};
}

PoseEstimates EstimateOneByOne(const StudyCell& cell, const Problem& problem) {
  const size_t num_cameras = problem.cameras.size();
  std::vector<std::optional<Mount>> mounts(num_cameras);
  PoseEstimates cameras(num_cameras);
  // The poses between bases, by the pair of the arms.
  std::vector<std::pair<size_t, size_t>> pairs;
  PoseEstimates bases;
  for (size_t a = 0; a < problem.robots.size(); ++a) {
    for (size_t b = a + 1; b < problem.robots.size(); ++b) pairs.emplace_back(a, b);
  }
  bases.resize(pairs.size());
  for (size_t c = 0; c < num_cameras; ++c) {
    const std::optional<SingleCamera> single = OnlyCamera(problem, c);
    if (!single) continue;
    mounts[c] = single->mount;
    const Outcome<Calibration> calibration = CalibrateAsKnown(cell, single->problem);
    const bool is_good = calibration && calibration->refined;
    Failure failure;
    if (!is_good) failure = calibration ? calibration->refined.failure() : calibration.failure();
    const std::vector<PoseEstimate> poses =
        is_good ? PosesOf(single->problem, *calibration->refined) : std::vector<PoseEstimate>();
    cameras[c] = is_good ? Outcome<PoseEstimate>(poses[0]) : failure;
    // Behind the pose of the camera are those between the bases of its arms.
    size_t next = 1;
    for (size_t a = 0; a < single->robots.size(); ++a) {
      for (size_t b = a + 1; b < single->robots.size(); ++b) {
        const auto place = std::find(pairs.begin(), pairs.end(), std::pair(single->robots[a], single->robots[b]));
        std::optional<Outcome<PoseEstimate>>& known = bases[static_cast<size_t>(place - pairs.begin())];
        if (!is_good) {
          if (!known) known = failure;
          continue;
        }
        const PoseEstimate& pose = poses[next++];
        const auto variance_m2 = [](const PoseEstimate& of) { return of.covariance.topLeftCorner<3, 3>().trace(); };
        if (!known || !known->ok() || variance_m2(pose) < variance_m2(**known)) known = pose;
      }
    }
  }
  PoseEstimates estimates;
  for (size_t c = 0; c < num_cameras; ++c) {
    const bool is_in_mount = mounts[c] && *mounts[c] == problem.cameras[c].mount;
    estimates.push_back(is_in_mount ? cameras[c] : std::nullopt);
  }
  for (size_t a = 0; a < num_cameras; ++a) {
    for (size_t b = a + 1; b < num_cameras; ++b) {
      if (MovesAgainst(problem.cameras[a].mount, problem.cameras[b].mount)) continue;
      std::optional<Outcome<PoseEstimate>>& estimate = estimates.emplace_back();
      if (!mounts[a] || !mounts[b] || !(*mounts[a] == *mounts[b])) continue;
      const Outcome<PoseEstimate>& of_a = *cameras[a];
      const Outcome<PoseEstimate>& of_b = *cameras[b];
      estimate = of_a && of_b ? Outcome<PoseEstimate>(Between(*of_a, *of_b))
                              : Outcome<PoseEstimate>((of_a ? of_b : of_a).failure());
    }
  }
  estimates.insert(estimates.end(), bases.begin(), bases.end());
  return estimates;
}

}  // namespace

std::vector<PoseEstimate> PosesOf(const Problem& problem, const Solution& solution) {
  const double dof = solution.covariance_dof;
  std::vector<PoseEstimate> poses;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const ProblemCamera& camera = problem.cameras[c];
    const auto covariance = PoseCovarianceOf(solution.covariance, CameraPoseBlock(camera));
    CHECK(covariance.has_value());
    poses.push_back({"camera " + camera.name + " in " + MountText(problem, camera), solution.poses.mount_from_camera[c],
                     *covariance, dof});
  }
  const auto add = [&](const std::string& kind, const std::vector<RelativePose>& relative) {
    for (const RelativePose& pose : relative) {
      poses.push_back(
          {kind + " " + pose.child + " in " + kind + " " + pose.parent, pose.parent_from_child, pose.covariance, dof});
    }
  };
  add("camera", RelativeCameraPoses(problem, solution));
  add("arm", RelativeBasePoses(problem, solution));
  return poses;
}

std::vector<PoseEstimate> TruePoses(const StudyCell& cell) {
  Solution truth;
  truth.poses = cell.poses;
  truth.covariance.layout = UnknownsOf(cell.problem);
  const Eigen::Index size = truth.covariance.layout.size();
  truth.covariance.matrix = Eigen::MatrixXd::Zero(size, size);
  return PosesOf(cell.problem, truth);
}

PoseEstimates EstimatePoses(const StudyCell& cell, StudyEstimator estimator, const Problem& problem) {
  if (estimator == StudyEstimator::kOneByOne) return EstimateOneByOne(cell, problem);
  const Outcome<Calibration> calibration = CalibrateAsKnown(cell, problem);
  const bool is_good = calibration && calibration->refined;
  if (!is_good) {
    const size_t num_poses = TruePoses(cell).size();
    return PoseEstimates(num_poses, calibration ? calibration->refined.failure() : calibration.failure());
  }
  const std::vector<PoseEstimate> poses = PosesOf(problem, *calibration->refined);
  return {poses.begin(), poses.end()};
}

}  // namespace heba
