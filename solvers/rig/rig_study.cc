#include "solvers/rig/rig_study.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/rng.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/uncertainty_limits.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/information.h"

namespace heba {
namespace {

// A pose of an estimate, with its covariance (m, rad, in the child frame) and the degrees of freedom of that.
struct PoseEstimate {
  Rigid3d pose;
  Matrix6 covariance = Matrix6::Zero();
  double dof = std::numeric_limits<double>::infinity();
};

// Returns the studied poses of a solution.
std::vector<PoseEstimate> PosesOf(const RigProblem& problem, const RigSolution& solution) {
  std::vector<PoseEstimate> poses;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const auto covariance = PoseCovarianceOf(solution.covariance, CameraPoseBlock(problem.cameras[c]));
    CHECK(covariance.has_value());
    poses.push_back({solution.poses.mount_from_camera[c], *covariance, solution.covariance_dof});
  }
  for (const auto& relative : {RelativeCameraPoses(problem, solution), RelativeBasePoses(problem, solution)}) {
    for (const RelativePose& pose : relative) {
      poses.push_back({pose.parent_from_child, pose.covariance, solution.covariance_dof});
    }
  }
  return poses;
}

// Returns a solution with the true poses and no uncertainty.
RigSolution TrueSolution(const RigStudyCell& cell) {
  RigSolution truth;
  truth.poses = cell.poses;
  truth.covariance.layout = RigUnknowns(cell.rig);
  const Eigen::Index size = truth.covariance.layout.size();
  truth.covariance.matrix = Eigen::MatrixXd::Zero(size, size);
  return truth;
}

// Returns the rig with captures that have this noise.
RigProblem Simulated(const RigStudyCell& cell, double noise_px, const RobotNoise& robot_noise, Rng* rng) {
  RigProblem problem = cell.rig;
  SceneOptions options = cell.simulation;
  options.noise_px = noise_px;
  options.robot_noise = robot_noise;
  problem.captures = SimulateCaptures(cell.rig, cell.poses, cell.targets, cell.arms, options, rng);
  return problem;
}

// Calibrates captures whose arms have white noise alone.
Outcome<RigCalibration> CalibrateAsKnown(RigProblem problem, RigCalibrationOptions options) {
  options.smooth = SmoothPoseErrors::kNone;
  for (size_t c = 0; c < problem.cameras.size() && options.has_camera.empty(); ++c) {
    problem.cameras[c].camera.params.clear();
  }
  return CalibrateRig(problem, options);
}

// A camera by itself.
struct SingleCamera {
  RigProblem problem;
  std::vector<size_t> robots;  // The indices of its arms in the rig.
  Mount mount;                 // The mount, in the rig, to which the camera's pose refers.
};

// Returns a camera with the targets that it sees and the arms that move these against it. Everything at rest is on the
// base of the first of these arms unless its own base is among them. Returns nothing if no arm moves a target that the
// camera sees.
std::optional<SingleCamera> OnlyCamera(const RigProblem& problem, size_t camera) {
  std::vector<bool> is_seen(problem.targets.size());
  for (const RigCapture& capture : problem.captures) {
    for (const RigImage& image : capture.images) {
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
  for (const RigCapture& capture : problem.captures) {
    RigCapture& kept = single.problem.captures.emplace_back();
    kept.name = capture.name;
    for (const size_t r : single.robots) kept.base_from_gripper.push_back(capture.base_from_gripper[r]);
    for (const RigImage& image : capture.images) {
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
  return {a_from_b.pose, a_from_b.by_unknowns * covariance * a_from_b.by_unknowns.transpose(),
          std::min(mount_from_a.dof, mount_from_b.dof)};
}

// An estimate of each studied pose. Poses that the estimator cannot determine have none, those that it failed to
// determine have a Failure.
using PoseEstimates = std::vector<std::optional<Outcome<PoseEstimate>>>;

PoseEstimates EstimateJointly(const RigStudyCell& cell, const RigProblem& problem, size_t num_poses) {
  const Outcome<RigCalibration> calibration = CalibrateAsKnown(problem, cell.options);
  if (!calibration) return PoseEstimates(num_poses, calibration.failure());
  if (!calibration->refined) return PoseEstimates(num_poses, calibration->refined.failure());
  PoseEstimates estimates;
  for (const PoseEstimate& pose : PosesOf(problem, *calibration->refined)) estimates.emplace_back(pose);
  return estimates;
}

PoseEstimates EstimateOneByOne(const RigStudyCell& cell, const RigProblem& problem, size_t num_poses) {
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
    RigCalibrationOptions options = cell.options;
    if (!options.has_camera.empty()) options.has_camera = {options.has_camera[c]};
    const Outcome<RigCalibration> calibration = CalibrateAsKnown(single->problem, options);
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
  CHECK_EQ(estimates.size(), num_poses);
  return estimates;
}

TrialEstimate EstimateOf(RigEstimator estimator, const Rigid3d& truth, const Outcome<PoseEstimate>& found) {
  TrialEstimate estimate;
  estimate.method = kRigEstimatorNames[static_cast<size_t>(estimator)];
  estimate.ok = found.ok();
  if (!found) return estimate;
  const Tangent6 error = LocalCoordinates(truth, found->pose);
  estimate.error = error;
  constexpr double kOutside = 0.05;
  estimate.is_covered = MahalanobisSquare(error, found->covariance) <= 6 * FisherQuantile(kOutside, 6, found->dof);
  return estimate;
}

StudyErrors FromMeanSquares(const Eigen::VectorXd& squares) {
  StudyErrors errors;
  errors.hand_eye_m = std::sqrt(squares.head<3>().sum());
  errors.hand_eye_rad = std::sqrt(squares.tail<3>().sum());
  return errors;
}

}  // namespace

std::vector<std::string> StudiedRigPoses(const RigStudyCell& cell) {
  std::vector<std::string> names;
  for (const RigCamera& camera : cell.rig.cameras) {
    names.push_back("camera " + camera.name + " in " + MountText(cell.rig, camera));
  }
  const RigSolution truth = TrueSolution(cell);
  for (const RelativePose& pose : RelativeCameraPoses(cell.rig, truth)) {
    names.push_back("camera " + pose.child + " in camera " + pose.parent);
  }
  for (const RelativePose& pose : RelativeBasePoses(cell.rig, truth)) {
    names.push_back("arm " + pose.child + " in arm " + pose.parent);
  }
  return names;
}

std::vector<std::vector<TrialEstimate>> RunRigTrial(const RigStudyCell& cell, uint64_t seed, int trial) {
  Rng rng(seed, static_cast<uint64_t>(trial));
  const RigProblem problem = Simulated(cell, cell.simulation.noise_px, cell.simulation.robot_noise, &rng);
  const std::vector<PoseEstimate> truth = PosesOf(cell.rig, TrueSolution(cell));
  std::vector<std::vector<TrialEstimate>> estimates(truth.size());
  for (const RigEstimator estimator : cell.estimators) {
    const PoseEstimates found = estimator == RigEstimator::kJointly ? EstimateJointly(cell, problem, truth.size())
                                                                    : EstimateOneByOne(cell, problem, truth.size());
    for (size_t i = 0; i < truth.size(); ++i) {
      if (found[i]) estimates[i].push_back(EstimateOf(estimator, truth[i].pose, *found[i]));
    }
  }
  return estimates;
}

Outcome<std::vector<Matrix6>> RigErrorBound(const RigStudyCell& cell) {
  Rng rng(0);
  auto problem = std::make_shared<RigProblem>(Simulated(cell, 0, RobotNoise(), &rng));
  Fit fit;
  fit.groups = GroupByRobotPoses(*problem);
  if (fit.groups.empty()) return Failure{FailureCode("no_target_in_view")};
  fit.state.poses = cell.poses;
  for (const RigCamera& camera : problem->cameras) fit.state.cameras.push_back(camera.camera);
  for (const RigTarget& target : problem->targets) fit.state.shapes.push_back(target.shape);
  fit.noise.pixel_px.assign(problem->cameras.size(), cell.simulation.noise_px);
  fit.noise.image_px.assign(problem->cameras.size(), 0);
  fit.noise.robots.assign(MovingRobots(*problem).size(), cell.simulation.robot_noise);
  fit.problem = std::move(problem);
  const std::optional<Information> information = FitInformation(fit, LossOf(LossKind::kNone), 1);
  CHECK(information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  RigSolution bound;
  bound.poses = cell.poses;
  bound.covariance = InvertInformation(*information, 1.0);
  std::vector<Matrix6> covariances;
  for (const PoseEstimate& pose : PosesOf(cell.rig, bound)) covariances.push_back(pose.covariance);
  return covariances;
}

std::vector<RigPoseSummary> SummariseRig(const RigStudyCell& cell,
                                         const std::vector<std::vector<std::vector<TrialEstimate>>>& trials) {
  const Outcome<std::vector<Matrix6>> bounds = RigErrorBound(cell);
  const std::vector<std::string> names = StudiedRigPoses(cell);
  std::vector<RigPoseSummary> summaries;
  for (size_t i = 0; i < names.size(); ++i) {
    RigPoseSummary& summary = summaries.emplace_back();
    summary.pose = names[i];
    summary.bound = bounds ? Outcome<StudyErrors>(FromMeanSquares((*bounds)[i].diagonal()))
                           : Outcome<StudyErrors>(bounds.failure());
    std::vector<std::vector<TrialEstimate>> of_pose;
    for (const std::vector<std::vector<TrialEstimate>>& trial : trials) of_pose.push_back(trial[i]);
    summary.methods = SummariseTrials(of_pose, &FromMeanSquares);
  }
  return summaries;
}

}  // namespace heba
