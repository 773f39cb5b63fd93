#include "solvers/calibration/observability.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "heba/base/even_indices.h"
#include "heba/base/factorisation.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// How a camera has seen a target.
struct Sight {
  std::vector<size_t> captures;
  int fewest_points = 0;
  double side = 0;          // The sign of the z component of the camera's position in the target.
  double least_cosine = 1;  // The least cosine of the angle of the ray to the target's normal.
  double farthest_m = 0;
};
using Sights = std::map<std::pair<size_t, size_t>, Sight>;

// The position of the centre of a target's points as a camera sees it.
struct Aspect {
  double distance_m = 0;
  double cosine = 0;  // Positive if the target's z axis points away from the camera.
};

Aspect AspectOf(const Rigid3d& camera_from_target, const Points3& points) {
  const Eigen::Vector3d centre = camera_from_target * Eigen::Vector3d(points.rowwise().mean());
  const Eigen::Vector3d normal = camera_from_target.rotation * Eigen::Vector3d::UnitZ();
  return {centre.norm(), normal.dot(centre.normalized())};
}

// The poses of the arms as they are in a capture.
std::vector<Rigid3d> PosesAt(const Problem& used, const Solution& solution, size_t capture) {
  return Corrected(WithErrors(used.captures[capture], solution.effects), solution.captures[capture].corrections);
}

Sights SightsOf(const Problem& used, const Solution& solution) {
  Sights sights;
  for (size_t i = 0; i < used.captures.size(); ++i) {
    const std::vector<Rigid3d> base_from_gripper = PosesAt(used, solution, i);
    for (const ProblemImage& image : used.captures[i].images) {
      if (image.observations.size() == 0) continue;
      const Aspect aspect =
          AspectOf(CameraFromTarget(used, solution.poses, image.camera, image.target, base_from_gripper),
                   image.observations.points_in_target);
      const auto [entry, is_new] = sights.try_emplace({image.camera, image.target});
      Sight& sight = entry->second;
      if (is_new) sight.fewest_points = image.observations.size();
      sight.captures.push_back(i);
      sight.fewest_points = std::min(sight.fewest_points, image.observations.size());
      sight.side += aspect.cosine < 0 ? -1 : 1;
      sight.least_cosine = std::min(sight.least_cosine, std::abs(aspect.cosine));
      sight.farthest_m = std::max(sight.farthest_m, aspect.distance_m);
    }
  }
  return sights;
}

// Returns all points of each target that any image has.
std::vector<Observations> PointsOfTargets(const Problem& used) {
  std::vector<std::map<int, std::pair<Eigen::Vector3d, double>>> points(used.targets.size());
  for (const ProblemCapture& capture : used.captures) {
    for (const ProblemImage& image : capture.images) {
      const Observations& seen = image.observations;
      for (int p = 0; p < seen.size(); ++p) {
        points[image.target].try_emplace(seen.ids[static_cast<size_t>(p)], seen.points_in_target.col(p),
                                         seen.RadiusM(p));
      }
    }
  }
  std::vector<Observations> of_targets;
  for (const auto& of_target : points) {
    Observations& all = of_targets.emplace_back();
    const auto count = static_cast<Eigen::Index>(of_target.size());
    all.points_in_target.resize(3, count);
    all.pixels.setZero(2, count);
    all.radii_m.setZero(count);
    for (const auto& [id, point] : of_target) {
      const auto place = static_cast<Eigen::Index>(all.ids.size());
      all.points_in_target.col(place) = point.first;
      all.radii_m[place] = point.second;
      all.ids.push_back(id);
    }
    if (all.radii_m.isZero(0)) all.radii_m.resize(0);
  }
  return of_targets;
}

// Makes captures at poses of the arms: the images of all cameras.
class Imagination {
 public:
  Imagination(const Problem& used, const Solution& solution, const Sights& sights)
      : used_(used), solution_(solution), sights_(sights), points_(PointsOfTargets(used)) {}

  // `like` is a capture with similar poses, whose shared effects hold, but for smooth errors, which are others.
  ProblemCapture At(const std::vector<Rigid3d>& base_from_gripper, size_t like) const {
    ProblemCapture capture{"", base_from_gripper, {}, used_.captures[like].effects, used_.captures[like].postures};
    for (size_t r = 0; r < capture.effects.size(); ++r) {
      const SharedEffects* const effects = EffectsOf(used_, r);
      if (effects != nullptr && effects->kind == SharedEffectsKind::kSmooth) capture.effects[r] = nullptr;
    }
    for (const auto& [pair, sight] : sights_) {
      std::optional<Observations> seen = Seen(pair.first, pair.second, sight, base_from_gripper);
      if (seen) capture.images.push_back({pair.first, pair.second, std::move(*seen)});
    }
    return capture;
  }

  const Observations& PointsOf(size_t target) const { return points_[target]; }

 private:
  std::optional<Observations> Seen(size_t camera, size_t target, const Sight& sight,
                                   const std::vector<Rigid3d>& base_from_gripper) const {
    const Observations& points = points_[target];
    const Rigid3d camera_from_target = CameraFromTarget(used_, solution_.poses, camera, target, base_from_gripper);
    const Aspect aspect = AspectOf(camera_from_target, points.points_in_target);
    // Targets are detected well up to this angle.
    const double least_cosine = std::min(sight.least_cosine, std::cos(DegToRad(60.0)));
    constexpr double kFarther = 1.3;
    if (aspect.cosine * sight.side <= 0 || std::abs(aspect.cosine) < least_cosine ||
        aspect.distance_m > kFarther * sight.farthest_m) {
      return std::nullopt;
    }
    std::optional<ImaginedPoints> imagined =
        ImaginePoints(solution_.cameras[camera], ApplyShape(points, solution_.shapes[target]), camera_from_target);
    if (!imagined) return std::nullopt;
    if (imagined->num_outside > 0 && imagined->inside.size() < sight.fewest_points) return std::nullopt;
    // The points as designed; the shape is an unknown of the adjustment.
    std::vector<bool> is_inside;
    const std::set<int> inside(imagined->inside.ids.begin(), imagined->inside.ids.end());
    for (const int id : points.ids) is_inside.push_back(inside.contains(id));
    Observations designed = KeepPoints(points, is_inside);
    designed.pixels = imagined->inside.pixels;
    return designed;
  }

  const Problem& used_;
  const Solution& solution_;
  const Sights& sights_;
  std::vector<Observations> points_;
};

// Returns the rows of a capture in units of their noise, that of the arms included.
std::optional<Eigen::MatrixXd> WhitenedRows(const Problem& used, const Solution& solution,
                                            const ProblemCapture& capture, const std::vector<size_t>& moving) {
  const Problem one{used.robots, used.cameras, used.targets, {capture}, used.effects};
  FitState state = StateOf(solution);
  state.corrections.clear();
  FitNoise noise = NoiseOf(solution);
  for (size_t k = 0; k < noise.robots.size(); ++k) noise.robots[k] = NoiseElsewhere(solution, moving[k]);
  const std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(ImageLoops(one, {{0}}, state, noise, moving), ValuesOf(state), 1, LossOf(LossKind::kNone));
  if (!views || views->empty()) return std::nullopt;
  std::vector<size_t> all(views->size());
  for (size_t v = 0; v < all.size(); ++v) all[v] = v;
  const LinearisedView view = std::move(StackGroups(*views, {all}).front());
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(one, moving));
  const Eigen::MatrixXd by_sigmas = view.by_effects * variances.cwiseSqrt().asDiagonal();
  return CholeskyFactor<Eigen::Dynamic>::OfIdentityPlusSquare(by_sigmas).SolveLower(view.by_unknowns);
}

// Returns whether a sigma is less by more than rounding: of captures that tell the same, the first ones are suggested.
bool IsLess(double sigma, double other) { return sigma < (1 - 1e-6) * other; }

bool SeesAnything(const CandidateCaptures& candidate) {
  return std::all_of(candidate.captures.begin(), candidate.captures.end(), [&](const ProblemCapture& capture) {
    return std::any_of(capture.images.begin(), capture.images.end(), [&](const ProblemImage& image) {
      return image.camera == candidate.camera && image.target == candidate.target;
    });
  });
}

// Returns what each camera sees in both captures: "left sees plate and wall, right sees plate".
std::string SightText(const Problem& problem, const CandidateCaptures& candidate) {
  std::vector<std::string> texts;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    std::vector<std::string> targets;
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      const bool is_seen =
          std::all_of(candidate.captures.begin(), candidate.captures.end(), [&](const ProblemCapture& capture) {
            return std::any_of(capture.images.begin(), capture.images.end(),
                               [&](const ProblemImage& image) { return image.camera == c && image.target == t; });
          });
      if (is_seen) targets.push_back(problem.targets[t].name);
    }
    if (!targets.empty()) texts.push_back(problem.cameras[c].name + " sees " + Join(targets, " and "));
  }
  return Join(texts, ", ");
}

// Returns the suggestion of a candidate for a camera. `before` and `after` have the worst direction of each camera.
Finding Suggest(const Problem& problem, const CandidateCaptures& candidate, size_t camera,
                const std::vector<WeakDirection>& before, const std::vector<double>& after) {
  const bool moves_target = problem.targets[candidate.target].mount == Mount{candidate.robot, Mount::Part::kGripper};
  Finding suggested = SuggestionOf(candidate.motion, moves_target, before[camera], after[camera]);
  size_t helped = camera;
  const auto ratio = [&](size_t c) { return after[c] / before[c].sigma; };
  for (size_t c = 0; c < before.size(); ++c) {
    if (IsLess(ratio(c), ratio(helped))) helped = c;
  }
  suggested.names.emplace_back("from_capture", problem.captures[candidate.capture].name);
  if (!problem.cameras[camera].name.empty()) {
    suggested.names.emplace_back("view_of_camera", problem.cameras[candidate.camera].name);
    suggested.names.emplace_back("view_of_target", problem.targets[candidate.target].name);
    if (problem.robots.size() > 1) suggested.names.emplace_back("by_arm", problem.robots[candidate.robot]);
    suggested.names.emplace_back("seen", SightText(problem, candidate));
  }
  suggested.numbers.emplace_back("helps_percent", 100 * (1 - ratio(camera)));
  if (helped != camera) {
    suggested.names.emplace_back("helps_most", problem.cameras[helped].name);
    suggested.names.emplace_back("helps_most_in", before[helped].name);
    suggested.numbers.emplace_back("helps_most_percent", 100 * (1 - ratio(helped)));
  }
  return suggested;
}

}  // namespace

std::vector<WeakDirection> DirectionsOfCamera(const Problem& problem, const Solution& solution, size_t camera) {
  const ProblemCamera& of_rig = problem.cameras[camera];
  const UnknownLayout& layout = solution.covariance.layout;
  const double distance_m = WorkingDistance(TargetPosesOf(problem, solution.poses, solution.effects, camera));
  std::vector<WeakDirection> directions;
  const auto add = [&](std::vector<WeakDirection> more) {
    for (WeakDirection& direction : more) directions.push_back(std::move(direction));
  };
  add(WorstDirections(solution.covariance.matrix, layout.Block(CameraPoseBlock(of_rig)).first,
                      solution.poses.mount_from_camera[camera], MountText(problem, of_rig), "camera", distance_m));
  for (size_t t = 0; t < problem.targets.size() && problem.cameras.size() == 1; ++t) {
    const ProblemTarget& target = problem.targets[t];
    add(WorstDirections(solution.covariance.matrix, layout.Block(TargetPoseBlock(target)).first,
                        solution.poses.mount_from_target[t], MountText(problem, target),
                        target.name.empty() ? "target" : "target " + target.name, distance_m));
  }
  add(IntrinsicDirections(solution.covariance, layout.Block(CameraBlock(of_rig)), solution.cameras[camera]));
  return ByNeed(std::move(directions));
}

std::vector<CandidateCaptures> FindCandidates(const Problem& used, const Solution& solution) {
  constexpr size_t kStarts = 4;
  const Sights sights = SightsOf(used, solution);
  const Imagination imagination(used, solution, sights);
  std::vector<CandidateCaptures> candidates;
  for (const auto& [pair, sight] : sights) {
    const auto [c, t] = pair;
    for (size_t r = 0; r < used.robots.size(); ++r) {
      if (!IsMovedBy(used.cameras[c].mount, used.targets[t].mount, r)) continue;
      for (const size_t start : EvenIndices(sight.captures.size(), kStarts)) {
        const size_t i = sight.captures[start];
        const std::vector<Rigid3d> poses = PosesAt(used, solution, i);
        for (CandidateMotion& motion :
             CandidateMotions(solution.cameras[c], CameraFromTarget(used, solution.poses, c, t, poses),
                              imagination.PointsOf(t).points_in_target.rowwise().mean())) {
          CandidateCaptures candidate{c, t, r, i, motion, {}};
          for (const Rigid3d& camera_from_target : motion.camera_from_target) {
            std::vector<Rigid3d> moved = poses;
            moved[r] = PoseOfArm(used, solution.poses, c, t, r, poses, camera_from_target);
            candidate.captures.push_back(imagination.At(moved, i));
          }
          if (SeesAnything(candidate)) candidates.push_back(std::move(candidate));
        }
      }
    }
  }
  return candidates;
}

std::optional<std::vector<double>> SigmasWith(const Problem& used, const Solution& solution,
                                              const CandidateCaptures& candidate,
                                              const std::vector<WeakDirection>& directions) {
  const Eigen::MatrixXd& covariance = solution.covariance.matrix;
  const std::vector<size_t> moving = MovingRobots(used);
  Eigen::MatrixXd rows(0, covariance.cols());
  for (const ProblemCapture& capture : candidate.captures) {
    const std::optional<Eigen::MatrixXd> more = WhitenedRows(used, solution, capture, moving);
    if (!more) return std::nullopt;
    const Eigen::Index known = rows.rows();
    rows.conservativeResize(known + more->rows(), Eigen::NoChange);
    rows.bottomRows(more->rows()) = *more;
  }
  // The covariance with more rows A of unit noise is C - C A' inv(I + A C A') A C.
  const Eigen::MatrixXd gain = rows * covariance;
  const Eigen::VectorXd sigmas_now = covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd scale = sigmas_now.cwiseInverse();
  const auto root = Cholesky(scale.asDiagonal() * covariance * scale.asDiagonal());
  if (!root) return std::nullopt;
  const Eigen::MatrixXd lower = root->lower().triangularView<Eigen::Lower>();
  const auto innovation = CholeskyFactor<Eigen::Dynamic>::OfIdentityPlusSquare(rows * sigmas_now.asDiagonal() * lower);
  std::vector<double> sigmas;
  for (const WeakDirection& direction : directions) {
    const Eigen::VectorXd reduced = innovation.SolveLower(gain * direction.direction);
    sigmas.push_back(std::sqrt(std::max(0.0, direction.sigma * direction.sigma - reduced.squaredNorm())));
  }
  return sigmas;
}

std::vector<Finding> DiagnoseDirections(const Problem& used, const Solution& solution) {
  std::vector<std::vector<WeakDirection>> directions;
  std::vector<WeakDirection> worst;
  for (size_t c = 0; c < used.cameras.size(); ++c) {
    directions.push_back(DirectionsOfCamera(used, solution, c));
    worst.push_back(directions.back().front());
    std::erase_if(directions.back(), [](const WeakDirection& direction) { return !direction.IsWeak(); });
    if (directions.back().empty()) directions.back().push_back(worst.back());
  }
  const std::vector<CandidateCaptures> candidates = FindCandidates(used, solution);
  std::vector<std::optional<std::vector<double>>> sigmas;
  sigmas.reserve(candidates.size());
  for (const CandidateCaptures& candidate : candidates) sigmas.push_back(SigmasWith(used, solution, candidate, worst));
  std::vector<Finding> findings;
  for (size_t c = 0; c < used.cameras.size(); ++c) {
    Finding finding = FindingOf(directions[c]);
    if (!used.cameras[c].name.empty()) finding.names.emplace_back("of_camera", used.cameras[c].name);
    size_t best = candidates.size();
    for (size_t k = 0; k < candidates.size(); ++k) {
      if (!sigmas[k] || (*sigmas[k])[c] >= kHelps * worst[c].sigma) continue;
      if (best == candidates.size() || IsLess((*sigmas[k])[c], (*sigmas[best])[c])) best = k;
    }
    if (best < candidates.size()) {
      finding.parts.push_back(Suggest(used, candidates[best], c, worst, *sigmas[best]));
    }
    findings.push_back(std::move(finding));
  }
  return findings;
}

std::optional<Finding> DiagnoseWeakDirections(const PairProblem& problem, const PairSolution& solution,
                                              const BundleOptions& options) {
  const Solution of_rig = ProblemSolution(solution);
  const Problem used = WithoutRejected(HandEyeProblem(problem, options), of_rig);
  if (!DirectionsOfCamera(used, of_rig, 0).front().IsWeak()) return std::nullopt;
  return std::move(DiagnoseDirections(used, of_rig).front());
}

}  // namespace heba
