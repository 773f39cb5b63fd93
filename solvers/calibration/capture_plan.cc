#include "heba/capture_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/rng.h"
#include "heba/data/hand_eye.h"
#include "heba/data/setup.h"
#include "heba/simulation/scene.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kVisible = 0.97;
constexpr int kNumRoughSetups = 200;
constexpr double kMarginPx = 10;

// Drawn counts the captures that were drawn, and those that were dropped by their cause.
struct Drawn {
  size_t num_all = 0;
  size_t num_outside = 0;    // IsAllowed is false.
  size_t num_unseen = 0;     // Too few rough set-ups see the whole target.
  size_t num_unreached = 0;  // The arm has no posture there that is permitted.
};

struct Candidate {
  PlannedCapture capture;
  Eigen::MatrixXd information;  // About the unknowns.
};

// The derivatives of the position of a located target by the unknowns.
using PlaceByUnknowns = Eigen::Matrix<double, 3, Eigen::Dynamic>;

Rigid3d MountOf(const PlanCell& cell, const Rigid3d& camera_from_target) {
  return cell.hand_eye.camera_mount_from_camera * camera_from_target * Inverse(cell.hand_eye.target_mount_from_target);
}

// Returns a pose that is off by about the stated sizes.
Rigid3d Rough(const Rigid3d& pose, const PlanCell& cell, Rng& rng) {
  const double per_axis = std::sqrt(1.0 / 3);
  Tangent6 error;
  error << cell.uncertainty_m * per_axis * rng.NormalVector3(), cell.uncertainty_rad * per_axis * rng.NormalVector3();
  return Retract(pose, error);
}

std::vector<HandEye> RoughSetups(const PlanCell& cell, Rng& rng) {
  std::vector<HandEye> setups;
  for (int i = 0; i < kNumRoughSetups; ++i) {
    HandEye& rough = setups.emplace_back();
    rough.camera_mount_from_camera = Rough(cell.hand_eye.camera_mount_from_camera, cell, rng);
    rough.target_mount_from_target = Rough(cell.hand_eye.target_mount_from_target, cell, rng);
  }
  return setups;
}

// Returns the share of set-ups in which the camera sees the whole target; stops once it is too small.
double VisibleShare(const PlanCell& cell, const std::vector<HandEye>& setups, const SimulatedTarget& target,
                    const Rigid3d& mount) {
  size_t num_seen = 0;
  for (size_t i = 0; i < setups.size(); ++i) {
    if (IsVisible(cell.camera, CameraFromTarget(setups[i], mount), target, kMarginPx)) ++num_seen;
    const size_t num_missed = i + 1 - num_seen;
    if (static_cast<double>(num_missed) > (1 - kVisible) * static_cast<double>(setups.size())) return 0;
  }
  return static_cast<double>(num_seen) / static_cast<double>(setups.size());
}

// Returns the points that bound what a camera sees of a target: those of the hull of its corners.
SimulatedTarget OutlineOf(const PlanCell& cell) {
  const Points3& points = cell.points_in_target;
  std::vector<Eigen::Index> picked;
  constexpr int kNumDirections = 16;
  for (int k = 0; k < kNumDirections; ++k) {
    const double angle = 2 * kPi * k / kNumDirections;
    Eigen::Index farthest = 0;
    (std::cos(angle) * points.row(0) + std::sin(angle) * points.row(1)).maxCoeff(&farthest);
    if (std::find(picked.begin(), picked.end(), farthest) == picked.end()) picked.push_back(farthest);
  }
  return {points(Eigen::all, picked), cell.z_out};
}

// Returns whether the gripper, and what it carries, may stand there.
bool IsAllowed(const PlanCell& cell, const SimulatedTarget& outline, const Rigid3d& base_from_gripper,
               const Rigid3d& camera_from_target) {
  const Eigen::Vector3d gripper = base_from_gripper.translation;
  if (cell.workspace && !cell.workspace->Contains(gripper)) return false;
  const bool carries_camera = cell.setup == Setup::kEyeInHand;
  const Rigid3d carried_in_gripper =
      carries_camera ? cell.hand_eye.camera_mount_from_camera : cell.hand_eye.target_mount_from_target;
  std::vector<Eigen::Vector3d> points = {gripper, base_from_gripper * carried_in_gripper.translation};
  for (Eigen::Index i = 0; i < outline.points_in_target.cols() && !carries_camera; ++i) {
    const Eigen::Vector3d point = outline.points_in_target.col(i);
    points.emplace_back(base_from_gripper * (carried_in_gripper * point));
  }
  for (const PlanBox& box : cell.keep_out) {
    if (std::any_of(points.begin(), points.end(), [&](const auto& point) { return box.Contains(point); })) return false;
  }
  if (carries_camera) return true;
  const Eigen::Vector3d camera = cell.hand_eye.camera_mount_from_camera.translation;
  return (camera - gripper).norm() >= cell.clearance_m && camera_from_target.translation.norm() >= cell.clearance_m;
}

// Returns the range of depths in which the target is drawn: from where it fits into the image in most directions, to
// where its points lie close together.
std::array<double, 2> DepthsOf(const PlanCell& cell) {
  const Eigen::Vector3d low = cell.points_in_target.rowwise().minCoeff();
  const Eigen::Vector3d high = cell.points_in_target.rowwise().maxCoeff();
  const double size_m = (high - low).norm();
  const double focal_px = 0.5 * (cell.camera.params[0] + cell.camera.params[1]);
  const double short_px = std::min(cell.camera.width_px, cell.camera.height_px);
  const double fits_m = focal_px * size_m / short_px;
  constexpr double kNearest = 1.1;
  constexpr double kFarthest = 4;
  return {std::max(cell.nearest_m, kNearest * fits_m), std::min(cell.farthest_m, kFarthest * fits_m)};
}

// Returns a pose of the target in front of the camera, with its front towards it.
Rigid3d DrawPose(const PlanCell& cell, const std::array<double, 2>& depths_m, Rng& rng) {
  const double depth_m = depths_m[0] * std::pow(depths_m[1] / depths_m[0], rng.Uniform());
  const Eigen::Vector3d pixel{rng.Uniform(0, cell.camera.width_px), rng.Uniform(0, cell.camera.height_px), 1};
  const Eigen::Vector3d ray((pixel.x() - cell.camera.params[2]) / cell.camera.params[0],
                            (pixel.y() - cell.camera.params[3]) / cell.camera.params[1], 1);
  // The normal of the target towards the camera is tilted against the line of sight.
  const double tilt_rad = cell.max_tilt_rad * std::sqrt(rng.Uniform());
  const double azimuth_rad = rng.Uniform(0, 2 * kPi);
  const double spin_rad = rng.Uniform(-kPi, kPi);
  const Eigen::Vector3d to_camera = -ray.normalized();
  const Eigen::Vector3d z = cell.z_out ? to_camera : Eigen::Vector3d(-to_camera);
  const Eigen::Quaterniond facing = RotationOnto(Eigen::Vector3d::UnitZ(), z);
  const Eigen::Vector3d axis(std::cos(azimuth_rad), std::sin(azimuth_rad), 0);
  const Eigen::Quaterniond rotation =
      facing * ExpRotation(tilt_rad * axis) * ExpRotation(spin_rad * Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d middle_in_target =
      0.5 * (cell.points_in_target.rowwise().minCoeff() + cell.points_in_target.rowwise().maxCoeff());
  Rigid3d camera_from_target;
  camera_from_target.rotation = rotation.normalized();
  camera_from_target.translation = depth_m * ray - camera_from_target.rotation * middle_in_target;
  return camera_from_target;
}

bool IsReached(const PlanCell& cell, const Rigid3d& base_from_gripper) {
  return !cell.postures || !cell.postures(base_from_gripper).empty();
}

// Returns the first posture of a configuration; nothing if there is none.
const PlanPosture* FirstPosture(const std::vector<PlanPosture>& postures, const std::string& configuration) {
  const auto first = std::find_if(postures.begin(), postures.end(),
                                  [&](const PlanPosture& posture) { return posture.configuration == configuration; });
  return first == postures.end() ? nullptr : &*first;
}

// Returns the posture nearest to another one; nothing if there is none of the configuration.
const PlanPosture* NearestPosture(const PlanCell& cell, const std::vector<PlanPosture>& postures,
                                  const Eigen::VectorXd& joints, const std::optional<std::string>& configuration) {
  const PlanPosture* nearest = nullptr;
  for (const PlanPosture& posture : postures) {
    if (configuration && posture.configuration != *configuration) continue;
    const bool is_nearer = nearest == nullptr || cell.posture_distance(posture.joints, joints) <
                                                     cell.posture_distance(nearest->joints, joints);
    if (is_nearer) nearest = &posture;
  }
  return nearest;
}

// The postures in which the arm reaches each capture.
using PosturesOfCaptures = std::vector<std::vector<PlanPosture>>;

// Returns the posture of each capture that is nearest to one of the first capture, in the configuration of that one if
// the arm reaches the capture there. The one of the first capture is chosen so that as few captures as possible have
// another configuration, and that the arm has the least to turn. The arm must reach all captures.
std::vector<PlanPosture> PosturesTogether(const PlanCell& cell, const PosturesOfCaptures& postures) {
  std::vector<PlanPosture> together;
  std::pair<int, double> least = {std::numeric_limits<int>::max(), 0};
  for (const PlanPosture& first : postures.front()) {
    std::vector<PlanPosture> chosen;
    std::pair<int, double> cost = {0, 0};  // The captures in other configurations, and the sum of distances.
    for (const std::vector<PlanPosture>& of_capture : postures) {
      const PlanPosture* nearest = NearestPosture(cell, of_capture, first.joints, first.configuration);
      if (nearest == nullptr) {
        nearest = NearestPosture(cell, of_capture, first.joints, std::nullopt);
        ++cost.first;
      }
      chosen.push_back(*nearest);
      cost.second += cell.posture_distance(nearest->joints, first.joints);
    }
    if (cost >= least) continue;
    least = cost;
    together = std::move(chosen);
  }
  return together;
}

// Returns how many captures the arm reaches in each configuration.
std::map<std::string, size_t> NumReached(const PosturesOfCaptures& postures) {
  std::map<std::string, size_t> num_reached;
  for (const std::vector<PlanPosture>& of_capture : postures) {
    std::set<std::string> reaching;
    for (const PlanPosture& posture : of_capture) reaching.insert(posture.configuration);
    for (const std::string& configuration : reaching) ++num_reached[configuration];
  }
  return num_reached;
}

// Returns how far apart two configurations are: the mean distance of their postures over the captures that both reach.
// Joints count to the next whole turn, after which an arm's errors are the same.
double DistanceOf(const PlanCell& cell, const PosturesOfCaptures& postures, const std::string& a,
                  const std::string& b) {
  double sum = 0;
  int num = 0;
  for (const std::vector<PlanPosture>& of_capture : postures) {
    const PlanPosture* const of_a = FirstPosture(of_capture, a);
    if (of_a == nullptr) continue;
    const PlanPosture* const of_b = NearestPosture(cell, of_capture, of_a->joints, b);
    if (of_b == nullptr) continue;
    sum += (of_a->joints - of_b->joints).unaryExpr([](double d) { return std::remainder(d, 2 * kPi); }).norm();
    ++num;
  }
  return num > 0 ? sum / num : 0;
}

// Returns the configuration that is the farthest from another one among those that reach nine in ten of the captures;
// nothing if there is none.
std::optional<std::string> FarthestConfiguration(const PlanCell& cell, const PosturesOfCaptures& postures,
                                                 const std::string& from) {
  constexpr double kLeastReached = 0.9;
  std::optional<std::string> farthest;
  double largest = 0;
  for (const auto& [configuration, num] : NumReached(postures)) {
    const bool is_enough = static_cast<double>(num) >= kLeastReached * static_cast<double>(postures.size());
    if (configuration == from || !is_enough) continue;
    const double distance = DistanceOf(cell, postures, configuration, from);
    if (distance <= largest) continue;
    largest = distance;
    farthest = configuration;
  }
  return farthest;
}

// Returns the captures with postures in one configuration or, if there are enough, the second half of the new ones in
// another one.
std::vector<PlannedCapture> WithPostures(std::vector<PlannedCapture> captures, const PlanCell& cell,
                                         bool has_one_configuration) {
  if (!cell.postures || captures.empty()) return captures;
  PosturesOfCaptures postures;
  for (const PlannedCapture& capture : captures) postures.push_back(cell.postures(capture.base_from_gripper));
  const std::vector<PlanPosture> together = PosturesTogether(cell, postures);
  for (size_t i = 0; i < captures.size(); ++i) captures[i].posture = together[i];
  const auto num_new = static_cast<size_t>(
      std::count_if(captures.begin(), captures.end(), [](const PlannedCapture& capture) { return !capture.repeats; }));
  constexpr size_t kLeastOfTwo = 10;
  if (has_one_configuration || num_new < kLeastOfTwo) return captures;
  const std::string& first = together.front().configuration;
  postures.resize(num_new);
  const std::optional<std::string> other = FarthestConfiguration(cell, postures, first);
  for (size_t i = 1; other && i < num_new; ++i) {
    const PlanPosture* const posture =
        NearestPosture(cell, postures[i], captures[i - 1].posture.joints, 2 * i < num_new ? first : *other);
    if (posture != nullptr) captures[i].posture = *posture;
  }
  for (PlannedCapture& capture : captures) {
    if (capture.repeats && cell.former_poses.empty()) capture.posture = captures[*capture.repeats].posture;
  }
  return captures;
}

// The filter decides by rough set-ups which captures the cell permits, and counts those that it does not permit.
class CaptureFilter {
 public:
  CaptureFilter(const PlanCell& cell, Rng& rng)
      : cell_(cell), setups_(RoughSetups(cell, rng)), outline_(OutlineOf(cell)) {}

  // Returns a capture with its pose and visible share; nothing if the cell does not permit it.
  std::optional<PlannedCapture> Completed(PlannedCapture capture) {
    const Rigid3d mount = MountOf(cell_, capture.camera_from_target);
    capture.base_from_gripper = BaseFromGripper(cell_.setup, mount);
    if (!IsAllowed(cell_, outline_, capture.base_from_gripper, capture.camera_from_target)) {
      ++drawn_.num_outside;
      return std::nullopt;
    }
    capture.visible_share = VisibleShare(cell_, setups_, outline_, mount);
    if (capture.visible_share < kVisible) {
      ++drawn_.num_unseen;
      return std::nullopt;
    }
    if (cell_.postures) {
      std::vector<PlanPosture> postures = cell_.postures(capture.base_from_gripper);
      if (postures.empty()) {
        ++drawn_.num_unreached;
        return std::nullopt;
      }
      postures_.push_back(std::move(postures));
    }
    return capture;
  }
  void CountDraw() { ++drawn_.num_all; }
  void CountUnseen() { ++drawn_.num_unseen; }
  const Drawn& drawn() const { return drawn_; }
  // Returns the postures in which the arm reaches the captures that the cell permits; an empty list without an arm.
  const PosturesOfCaptures& postures() const { return postures_; }

 private:
  const PlanCell& cell_;
  const std::vector<HandEye> setups_;
  const SimulatedTarget outline_;
  Drawn drawn_;
  PosturesOfCaptures postures_;
};

// Captures that were drawn.
struct DrawnCaptures {
  std::vector<PlannedCapture> captures;
  Drawn drawn;
};

// Returns the captures that the arm reaches in the configuration in which it reaches most of them; all if those are
// fewer than `least`, or if there is no arm.
std::vector<PlannedCapture> InOneConfiguration(std::vector<PlannedCapture> captures, const PosturesOfCaptures& postures,
                                               size_t least) {
  const std::map<std::string, size_t> num_reached = NumReached(postures);
  const auto most = std::max_element(num_reached.begin(), num_reached.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == num_reached.end() || most->second < least) return captures;
  std::vector<PlannedCapture> reached;
  for (size_t i = 0; i < captures.size(); ++i) {
    if (FirstPosture(postures[i], most->first) != nullptr) reached.push_back(std::move(captures[i]));
  }
  return reached;
}

DrawnCaptures DrawCandidates(const PlanCell& cell, const PlanOptions& options, Rng& rng) {
  CaptureFilter filter(cell, rng);
  const std::array<double, 2> depths_m = DepthsOf(cell);
  std::vector<PlannedCapture> candidates;
  constexpr size_t kMostDraws = 60000;
  while (candidates.size() < static_cast<size_t>(options.num_candidates) && filter.drawn().num_all < kMostDraws) {
    filter.CountDraw();
    PlannedCapture capture;
    capture.camera_from_target = DrawPose(cell, depths_m, rng);
    if (cell.nearest_reached) {
      const Rigid3d wanted = BaseFromGripper(cell.setup, MountOf(cell, capture.camera_from_target));
      capture.camera_from_target =
          CameraFromTarget(cell.hand_eye, CameraMountFromTargetMount(cell.setup, cell.nearest_reached(wanted)));
    }
    if (std::optional<PlannedCapture> completed = filter.Completed(std::move(capture))) {
      candidates.push_back(*std::move(completed));
    }
  }
  const auto least = static_cast<size_t>(options.is_two_step ? 1 : options.count);
  return {InOneConfiguration(std::move(candidates), filter.postures(), least), filter.drawn()};
}

// The cell as a problem, whose unknowns are the two poses and the free intrinsics.
struct PlanProblem {
  Problem problem;
  Solution solution;
};

PlanProblem ProblemOf(const PlanCell& cell, bool is_exact) {
  PlanProblem plan;
  plan.problem = HandEyeProblem(cell.setup, cell.camera, DesignedShape(cell.points_in_target));
  plan.problem.cameras.front().free_intrinsics = cell.free_intrinsics;
  Solution& solution = plan.solution;
  solution.poses = HandEyePosesOf(cell.hand_eye);
  solution.cameras = {cell.camera};
  solution.shapes = {plan.problem.targets.front().shape};
  solution.pixel_sigmas_px = {cell.pixel_noise_px};
  solution.image_sigmas_px = {0};
  solution.unmodelled_sigma_px = {std::nullopt};
  solution.robot_noise = {is_exact ? std::nullopt : std::optional<RobotNoise>(cell.robot_noise)};
  solution.robot_noise_stddev = {std::nullopt};
  return plan;
}

// Returns what an image of the target at a pose says; nothing if a point has no image.
std::optional<LinearisedView> Linearise(const PlanCell& cell, PlanProblem plan, const Rigid3d& camera_from_target) {
  Rng none(0);
  const Rigid3d mount = MountOf(cell, camera_from_target);
  const std::optional<View> view = SimulateView("", cell.camera, cell.hand_eye, mount, cell.points_in_target, 0, none);
  if (!view) return std::nullopt;
  ProblemCapture& capture = plan.problem.captures.emplace_back();
  capture.base_from_gripper = {BaseFromGripper(cell.setup, mount)};
  capture.images.push_back({0, 0, view->observations});
  CaptureOutcome& outcome = plan.solution.captures.emplace_back();
  if (plan.solution.robot_noise.front()) outcome.corrections = {Rigid3d()};
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(plan.problem, StateOf(plan.solution), NoiseOf(plan.solution), LossOf(LossKind::kNone));
  if (!views || views->size() != 1) return std::nullopt;
  return std::move(views->front());
}

std::vector<Candidate> WithInformation(const PlanCell& cell, const std::vector<PlannedCapture>& captures) {
  const PlanProblem plan = ProblemOf(cell, false);
  const Eigen::VectorXd variances = CorrectionVariances(cell.robot_noise);
  std::vector<Candidate> candidates;
  for (const PlannedCapture& capture : captures) {
    const std::optional<LinearisedView> view = Linearise(cell, plan, capture.camera_from_target);
    if (!view) continue;
    const RowMajorMatrix rows = WhitenedRows(*view, 1, variances);
    const auto by_unknowns = rows.leftCols(rows.cols() - 1);
    candidates.push_back({capture, by_unknowns.transpose() * by_unknowns});
  }
  return candidates;
}

// Returns how the position of the middle of a target that is seen at a pose, in the frame of the camera's mount,
// depends on the camera's pose and on its intrinsics, by which the target is located from its image.
std::optional<PlaceByUnknowns> LinearisePlace(const PlanCell& cell, const PlanProblem& exact,
                                              const UnknownLayout& layout, const Rigid3d& camera_from_target) {
  const std::optional<LinearisedView> view = Linearise(cell, exact, camera_from_target);
  if (!view) return std::nullopt;
  const Eigen::Index camera_pose = layout.Block(CameraPoseBlock(exact.problem.cameras.front())).first;
  const Eigen::Index target_pose = layout.Block(TargetPoseBlock(exact.problem.targets.front())).first;
  // The pose of the target at the end of the chain stands for that of the target in the camera.
  const auto by_seen_pose = view->by_unknowns.middleCols<6>(target_pose);
  Eigen::MatrixXd seen_pose_by = Eigen::MatrixXd::Zero(6, layout.size());
  const UnknownBlock camera = layout.Block(CameraBlock(exact.problem.cameras.front()));
  if (camera.size > 0) {
    seen_pose_by.middleCols(camera.first, camera.size) =
        -by_seen_pose.colPivHouseholderQr().solve(view->by_unknowns.middleCols(camera.first, camera.size));
  }
  const Eigen::Vector3d middle_in_target =
      0.5 * (cell.points_in_target.rowwise().minCoeff() + cell.points_in_target.rowwise().maxCoeff());
  const Eigen::Matrix3d mount_from_camera = cell.hand_eye.camera_mount_from_camera.RotationMatrix();
  PlaceByUnknowns by_unknowns =
      mount_from_camera * camera_from_target.RotationMatrix() * PointByMotion(middle_in_target) * seen_pose_by;
  by_unknowns.middleCols<6>(camera_pose) += mount_from_camera * PointByMotion(camera_from_target * middle_in_target);
  return by_unknowns;
}

// Returns the poses at which targets will be located: at the places, facing the camera, or a sample of the candidates.
std::vector<Rigid3d> PosesToLocate(const PlanCell& cell, const std::vector<Candidate>& candidates) {
  std::vector<Rigid3d> poses;
  if (!cell.places_in_base_m.empty() && cell.setup == Setup::kEyeToHand) {
    const Rigid3d camera_from_base = Inverse(cell.hand_eye.camera_mount_from_camera);
    for (const Eigen::Vector3d& place : cell.places_in_base_m) {
      Rigid3d& pose = poses.emplace_back();
      pose.translation = camera_from_base * place;
      const Eigen::Vector3d to_camera = -pose.translation.normalized();
      pose.rotation = RotationOnto(Eigen::Vector3d::UnitZ(), cell.z_out ? to_camera : Eigen::Vector3d(-to_camera)) *
                      ExpRotation(Eigen::Vector3d(0.3, 0.3, 0));
    }
    return poses;
  }
  constexpr size_t kMostPlaces = 12;
  const size_t step = std::max<size_t>(1, candidates.size() / kMostPlaces);
  for (size_t i = 0; i < candidates.size(); i += step) poses.push_back(candidates[i].capture.camera_from_target);
  return poses;
}

// Returns the information about the unknowns before the session.
Eigen::MatrixXd KnownInformation(const PlanCell& cell, const UnknownLayout& layout) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(layout.size(), layout.size());
  std::vector<Eigen::Index> places;
  std::vector<Eigen::Index> of_known;
  for (Eigen::Index i = 0; i < layout.size(); ++i) {
    const std::optional<Eigen::Index> known = cell.known.layout.Place(layout.Name(i));
    if (known) {
      places.push_back(i);
      of_known.push_back(*known);
      continue;
    }
    const double focal_px = 0.5 * (cell.camera.params[0] + cell.camera.params[1]);
    constexpr double kShareOfFocal = 0.1;
    constexpr double kAnyDistortion = 0.3;
    double sigma = kAnyDistortion;
    switch (layout[i].group) {
      case UnknownGroup::kTranslation:
        sigma = cell.uncertainty_m;
        break;
      case UnknownGroup::kRotation:
        sigma = cell.uncertainty_rad;
        break;
      case UnknownGroup::kFocal:
      case UnknownGroup::kPrincipalPoint:
        sigma = kShareOfFocal * focal_px;
        break;
      default:
        break;
    }
    covariance(i, i) = sigma * sigma;
  }
  if (!places.empty()) covariance(places, places) = cell.known.matrix(of_known, of_known);
  const auto factor = Cholesky(covariance);
  return factor ? factor->Inverse() : Eigen::MatrixXd::Zero(layout.size(), layout.size());
}

// A criterion says how well a session locates targets and the camera.
class Criterion {
 public:
  Criterion(const UnknownLayout& layout, const Problem& problem, std::vector<PlaceByUnknowns> places)
      : places_(std::move(places)),
        camera_pose_(layout.Block(CameraPoseBlock(problem.cameras.front())).first),
        is_of_variances_(problem.cameras.front().free_intrinsics.empty()) {}

  // Returns the logarithm of the mean variance or, with free intrinsics, the mean logarithm of the determinants;
  // infinite if the information is not positive.
  double ValueOf(const Eigen::MatrixXd& information) const {
    const auto factor = Cholesky(information);
    if (!factor) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (const PlaceByUnknowns& place : places_) {
      const Eigen::MatrixXd solved = factor->SolveLower(place.transpose());
      const Eigen::Matrix3d covariance = solved.transpose() * solved;
      sum += is_of_variances_ ? covariance.trace() : std::log(covariance.determinant());
    }
    const double mean = sum / static_cast<double>(places_.size());
    return is_of_variances_ ? std::log(mean) : mean;
  }
  // Returns the directions of the camera's pose of which the captures between two states of information tell little.
  std::vector<UntoldDirection> UntoldOf(const Rigid3d& mount_from_camera, const Eigen::MatrixXd& before,
                                        const Eigen::MatrixXd& after) const {
    const auto factor_before = Cholesky(before);
    const auto factor_after = Cholesky(after);
    std::vector<UntoldDirection> untold;
    if (!factor_before || !factor_after) return untold;
    const Eigen::MatrixXd covariance_before = factor_before->Inverse();
    const Eigen::MatrixXd covariance_after = factor_after->Inverse();
    for (const bool is_rotation : {false, true}) {
      const Eigen::Index first = camera_pose_ + (is_rotation ? 3 : 0);
      const SymmetricEigen<3> eigen = EigenOfSymmetric(Eigen::Matrix3d(covariance_after.block<3, 3>(first, first)));
      const Eigen::Vector3d direction = eigen.vectors.col(2);
      const double sigma = std::sqrt(eigen.values[2]);
      const double sigma_before = std::sqrt(direction.dot(covariance_before.block<3, 3>(first, first) * direction));
      constexpr double kMostLeft = 0.5;
      constexpr double kSmallM = 5e-3;
      constexpr double kSmallRad = DegToRad(1);
      if (sigma < kMostLeft * sigma_before || sigma < (is_rotation ? kSmallRad : kSmallM)) continue;
      untold.push_back({mount_from_camera.rotation * direction, is_rotation, sigma});
    }
    return untold;
  }
  // Returns a capture with the sigmas after it.
  PlannedCapture WithSigmas(PlannedCapture capture, const Eigen::MatrixXd& information) const {
    const auto factor = Cholesky(information);
    if (!factor) return capture;
    const Eigen::MatrixXd covariance = factor->Inverse();
    double sum_m2 = 0;
    for (const PlaceByUnknowns& place : places_) sum_m2 += (place * covariance * place.transpose()).trace();
    capture.target_m = std::sqrt(sum_m2 / static_cast<double>(places_.size()));
    capture.position_m = std::sqrt(covariance.diagonal().segment<3>(camera_pose_).sum());
    capture.orientation_rad = std::sqrt(covariance.diagonal().segment<3>(camera_pose_ + 3).sum());
    return capture;
  }

 private:
  std::vector<PlaceByUnknowns> places_;
  Eigen::Index camera_pose_;
  bool is_of_variances_;
};

// Returns the index of the candidate that makes the criterion least beside `information`, without those that are taken.
size_t BestBeside(const std::vector<Candidate>& candidates, const std::vector<size_t>& taken,
                  const Eigen::MatrixXd& information, const Criterion& criterion) {
  size_t best = candidates.size();
  double best_value = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (std::find(taken.begin(), taken.end(), i) != taken.end()) continue;
    const double value = criterion.ValueOf(information + candidates[i].information);
    if (value >= best_value) continue;
    best_value = value;
    best = i;
  }
  return best;
}

// Returns the chosen candidates: one after the other, then each exchanged for a better one, until none is.
std::vector<size_t> Choose(const std::vector<Candidate>& candidates, size_t count, const Eigen::MatrixXd& known,
                           const Criterion& criterion) {
  std::vector<size_t> chosen;
  Eigen::MatrixXd information = known;
  const auto add = [&](size_t i) {
    chosen.push_back(i);
    information += candidates[i].information;
  };
  while (chosen.size() < count) {
    const size_t best = BestBeside(candidates, chosen, information, criterion);
    if (best == candidates.size()) break;
    add(best);
  }
  constexpr int kMostRounds = 4;
  for (int round = 0; round < kMostRounds; ++round) {
    bool is_changed = false;
    for (size_t k = 0; k < chosen.size(); ++k) {
      const Eigen::MatrixXd without = information - candidates[chosen[k]].information;
      const double value = criterion.ValueOf(information);
      const size_t best = BestBeside(candidates, chosen, without, criterion);
      if (best == candidates.size()) continue;
      constexpr double kGain = 1e-3;
      if (criterion.ValueOf(without + candidates[best].information) >= value - kGain) continue;
      information = without + candidates[best].information;
      chosen[k] = best;
      is_changed = true;
    }
    if (!is_changed) break;
  }
  // The most telling come first.
  std::vector<size_t> ordered;
  std::vector<Candidate> rest;
  for (const size_t i : chosen) rest.push_back(candidates[i]);
  information = known;
  std::vector<size_t> taken;
  while (taken.size() < rest.size()) {
    const size_t best = BestBeside(rest, taken, information, criterion);
    if (best == rest.size()) break;
    taken.push_back(best);
    ordered.push_back(chosen[best]);
    information += rest[best].information;
  }
  return ordered;
}

// Returns the captures of the two-step method that the cell allows.
DrawnCaptures TwoStepCaptures(const PlanCell& cell, const PlanOptions& options,
                              const std::vector<Candidate>& candidates, Rng& rng) {
  CaptureFilter filter(cell, rng);
  MotionOptions home;
  home.depth_ratio = 0.1;
  home.spread = 0.1;
  TwoStepMotionOptions motion;
  constexpr int kNumBefore = 3;  // The home pose and the translations.
  motion.num_turns = std::max(2, options.count - kNumBefore);
  constexpr int kMostTries = 3000;
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    // Motions that are too large for the image or the workspace are made smaller.
    constexpr double kLeastShare = 0.1;
    const double share = std::pow(kLeastShare, static_cast<double>(attempt) / kMostTries);
    // The home pose is as far away as a pose that the cell allows.
    const int like = rng.Index(static_cast<int>(candidates.size()));
    home.distance_m = candidates[static_cast<size_t>(like)].capture.camera_from_target.translation.z();
    motion.translation_m = share * TwoStepMotionOptions().translation_m;
    motion.max_turn_rad = share * TwoStepMotionOptions().max_turn_rad;
    const Outcome<std::vector<SimulatedPose>> poses = SimulateTwoStepPoses(
        cell.setup, cell.camera, cell.points_in_target, cell.z_out, cell.hand_eye, home, motion, rng);
    filter.CountDraw();
    if (!poses) {
      filter.CountUnseen();
      continue;
    }
    std::vector<PlannedCapture> captures;
    for (const SimulatedPose& pose : *poses) {
      PlannedCapture capture;
      capture.role = pose.role;
      capture.camera_from_target = pose.camera_from_target;
      std::optional<PlannedCapture> completed = filter.Completed(std::move(capture));
      if (!completed) break;
      captures.push_back(*std::move(completed));
    }
    if (captures.size() == poses->size()) return {std::move(captures), filter.drawn()};
  }
  return {{}, filter.drawn()};
}

Failure WhyTooFew(const Drawn& drawn, size_t num_found, int wanted) {
  return {FailureCode("few_planned"),
          {{"found", static_cast<double>(num_found)},
           {"wanted", static_cast<double>(wanted)},
           {"drawn", static_cast<double>(drawn.num_all)},
           {"outside", static_cast<double>(drawn.num_outside)},
           {"unseen", static_cast<double>(drawn.num_unseen)},
           {"unreached", static_cast<double>(drawn.num_unreached)}}};
}

// Returns the captures with the first of them once more or, if there are any, the first poses of the earlier session
// that the arm reaches.
std::vector<PlannedCapture> WithRevisits(std::vector<PlannedCapture> captures, const PlanCell& cell, int num_revisits) {
  const size_t num_planned = captures.size();
  const bool has_former = !cell.former_poses.empty();
  const size_t num_first = has_former ? cell.former_poses.size() : num_planned;
  const size_t num_wanted = num_planned + static_cast<size_t>(std::max(0, num_revisits));
  for (size_t k = 0; k < num_first && captures.size() < num_wanted; ++k) {
    if (has_former && !IsReached(cell, cell.former_poses[k])) continue;
    PlannedCapture again = captures[has_former ? num_planned - 1 : k];
    if (has_former) {
      again.base_from_gripper = cell.former_poses[k];
      again.camera_from_target =
          CameraFromTarget(cell.hand_eye, CameraMountFromTargetMount(cell.setup, again.base_from_gripper));
      again.visible_share = 1;
      again.posture = {};
    }
    const PlannedCapture& last = captures.back();
    again.repeats = k;
    again.target_m = last.target_m;
    again.position_m = last.position_m;
    again.orientation_rad = last.orientation_rad;
    captures.push_back(std::move(again));
  }
  return captures;
}

}  // namespace

Outcome<CapturePlan> PlanCaptures(const PlanCell& cell, const PlanOptions& options) {
  const std::array<double, 2> depths_m = DepthsOf(cell);
  if (!(depths_m[0] < depths_m[1])) {
    PlanCell anywhere = cell;
    anywhere.nearest_m = 0;
    anywhere.farthest_m = std::numeric_limits<double>::infinity();
    const std::array<double, 2> needed_m = DepthsOf(anywhere);
    return Failure{FailureCode("no_planned_depth"), {{"from_mm", 1000 * needed_m[0]}, {"to_mm", 1000 * needed_m[1]}}};
  }
  Rng rng(options.seed);
  CapturePlan plan;
  const DrawnCaptures drawn = DrawCandidates(cell, options, rng);
  const std::vector<Candidate> candidates = WithInformation(cell, drawn.captures);
  plan.num_candidates = candidates.size();
  if (candidates.size() < static_cast<size_t>(options.is_two_step ? 1 : options.count)) {
    return WhyTooFew(drawn.drawn, candidates.size(), options.count);
  }
  const PlanProblem exact = ProblemOf(cell, true);
  const UnknownLayout layout = UnknownsOf(exact.problem);
  std::vector<PlaceByUnknowns> places;
  for (const Rigid3d& pose : PosesToLocate(cell, candidates)) {
    std::optional<PlaceByUnknowns> place = LinearisePlace(cell, exact, layout, pose);
    if (place) places.push_back(std::move(*place));
  }
  if (places.empty()) return Failure{FailureCode("no_planned_place")};
  const Criterion criterion(layout, exact.problem, std::move(places));
  Eigen::MatrixXd information = KnownInformation(cell, layout);
  plan.target_before_m = criterion.WithSigmas({}, information).target_m;

  std::vector<Candidate> chosen;
  if (options.is_two_step) {
    const DrawnCaptures of_motion = TwoStepCaptures(cell, options, candidates, rng);
    chosen = WithInformation(cell, of_motion.captures);
    if (chosen.empty()) return WhyTooFew(of_motion.drawn, 0, options.count);
  } else {
    for (const size_t i : Choose(candidates, static_cast<size_t>(options.count), information, criterion)) {
      chosen.push_back(candidates[i]);
    }
    if (chosen.size() < static_cast<size_t>(options.count)) return WhyTooFew(drawn.drawn, chosen.size(), options.count);
  }
  const Eigen::MatrixXd before = information;
  for (Candidate& one : chosen) {
    information += one.information;
    plan.captures.push_back(criterion.WithSigmas(std::move(one.capture), information));
  }
  plan.untold = criterion.UntoldOf(cell.hand_eye.camera_mount_from_camera, before, information);
  if (!options.is_two_step) plan.captures = WithRevisits(std::move(plan.captures), cell, options.num_revisits);
  plan.captures = WithPostures(std::move(plan.captures), cell, options.is_two_step);
  std::vector<Rigid3d> poses;
  std::vector<size_t> order;
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    poses.push_back(plan.captures[i].base_from_gripper);
    order.push_back(i);
  }
  plan.order_by_pose = OrderByPose(poses, order);
  return plan;
}

}  // namespace heba
