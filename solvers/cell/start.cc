#include "solvers/cell/start.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/parallel.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/cell/placing.h"
#include "solvers/initial/intrinsics.h"

namespace heba {
namespace {

using Kind = CellPart::Kind;

// The pose of a part in another of the same body.
struct Edge {
  CellPart parent;
  CellPart child;
  Rigid3d parent_from_child;
  double variance_m2 = 0;  // Of a point half a metre away, for comparison with other edges.
};

// Returns the images of a pair as views. Their mounts' pose is that of a hand-eye calibration with `robot`, if it is
// set.
std::vector<View> ViewsOf(const Problem& problem, size_t camera, size_t target, std::optional<size_t> robot) {
  std::vector<View> views;
  const bool is_in_hand = problem.cameras[camera].mount.part == Mount::Part::kGripper;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const ProblemCapture& capture = problem.captures[i];
    for (const ProblemImage& image : capture.images) {
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

// Returns the images of a pair.
std::vector<PlacingImage> ImagesOfPair(const CalibratedPair& pair, const std::vector<PlacingImage>& images) {
  std::vector<PlacingImage> of_pair;
  for (const PlacingImage& image : images) {
    if (image.image->camera == pair.camera && image.image->target == pair.target) of_pair.push_back(image);
  }
  return of_pair;
}

// Returns the edges that a calibrated pair gives, or the pose of the target in the camera of a pair at rest.
std::vector<Edge> EdgesOf(const Problem& problem, const CalibratedPair& pair, const std::vector<PlacingImage>& images) {
  const Mount& camera_mount = problem.cameras[pair.camera].mount;
  const Mount& target_mount = problem.targets[pair.target].mount;
  const CellPart camera{Kind::kCamera, pair.camera};
  const CellPart target{Kind::kTarget, pair.target};
  if (pair.robot) {
    if (!pair.calibration || !pair.calibration->refined) return {};
    const PairSolution& solution = *pair.calibration->refined;
    const bool is_in_hand = camera_mount.part == Mount::Part::kGripper;
    const CellPart base = BasePart(*pair.robot);
    const CellPart gripper = GripperPart(*pair.robot);
    return {{is_in_hand ? gripper : base, camera, solution.hand_eye.camera_mount_from_camera,
             PointVarianceM2(*PoseCovarianceOf(solution.covariance, kHandEyeBlock))},
            {is_in_hand ? base : gripper, target, solution.hand_eye.target_mount_from_target,
             PointVarianceM2(*PoseCovarianceOf(solution.covariance, kBoardBlock))}};
  }
  if (MovesAgainst(camera_mount, target_mount)) return {};
  const std::vector<Placement> placements =
      PlaceByImages(problem, {{camera, Rigid3d()}}, target, ImagesOfPair(pair, images));
  if (placements.empty()) return {};
  return {{camera, target, placements.front().pose, placements.front().variance_m2}};
}

bool IsSymmetric(const Problem& problem, size_t target) { return problem.targets[target].symmetries.size() > 1; }

// Returns whether an edge determines the pose of its unplaced end. From a symmetric target that is placed it does not:
// the target was read in one of several orders.
bool IsUsable(const Problem& problem, const PartPoses& placed, const Edge& edge) {
  if (placed.contains(edge.parent) == placed.contains(edge.child)) return false;
  const bool is_target = edge.child.kind == Kind::kTarget;
  return !(is_target && placed.contains(edge.child) && IsSymmetric(problem, edge.child.index));
}

// A part that images can place, because the other parts in them are placed.
struct Placeable {
  CellPart part;
  std::vector<PlacingImage> images;
  bool is_ambiguous = true;  // All its images show a symmetric target whose orientation is known already.
  int num_points = 0;
};

// Returns the parts that images can place: those that are not ambiguous first, and those with many points before
// others.
std::vector<Placeable> PlaceableParts(const Problem& problem, const PartPoses& placed,
                                      const std::vector<PlacingImage>& images) {
  std::map<CellPart, Placeable> parts;
  for (const PlacingImage& image : images) {
    std::vector<CellPart> missing = image.parts;
    std::erase_if(missing, [&](const CellPart& part) { return placed.contains(part); });
    if (missing.size() != 1) continue;
    Placeable& placeable = parts[missing.front()];
    placeable.part = missing.front();
    placeable.images.push_back(image);
    placeable.num_points += image.image->observations.size();
    if (placeable.part.kind == Kind::kTarget || !IsSymmetric(problem, image.image->target)) {
      placeable.is_ambiguous = false;
    }
  }
  std::vector<Placeable> sorted;
  for (auto& [part, placeable] : parts) sorted.push_back(std::move(placeable));
  std::stable_sort(sorted.begin(), sorted.end(), [](const Placeable& a, const Placeable& b) {
    return a.is_ambiguous != b.is_ambiguous ? b.is_ambiguous : a.num_points > b.num_points;
  });
  return sorted;
}

// A part that was placed in several poses, because a symmetric target looks the same in several orientations.
struct AmbiguousPart {
  CellPart part;
  size_t target = 0;
};

// A rig as it is joined. The hypotheses have the same parts in other poses, and nothing has told them apart yet.
struct Joining {
  std::vector<PartPoses> hypotheses;
  std::vector<AmbiguousPart> ambiguous;
};

// Returns it with the end of an edge placed.
Joining WithEdge(Joining joining, const Edge& edge) {
  for (PartPoses& poses : joining.hypotheses) {
    if (poses.contains(edge.parent)) {
      poses[edge.child] = poses[edge.parent] * edge.parent_from_child;
    } else {
      poses[edge.parent] = poses[edge.child] * Inverse(edge.parent_from_child);
    }
  }
  return joining;
}

// Returns it with a part placed by its images; nothing if no image determines its pose.
std::optional<Joining> WithPart(const Joining& before, const Problem& problem, const Placeable& placeable) {
  Joining joining{{}, before.ambiguous};
  for (const PartPoses& poses : before.hypotheses) {
    const std::vector<Placement> placements = PlaceByImages(problem, poses, placeable.part, placeable.images);
    if (placements.size() > 1) joining.ambiguous.push_back({placeable.part, placements.front().target});
    for (const Placement& placement : placements) {
      joining.hypotheses.push_back(poses);
      joining.hypotheses.back()[placeable.part] = placement.pose;
    }
  }
  return joining.hypotheses.empty() ? std::nullopt : std::optional(std::move(joining));
}

// Returns the hypotheses that do not explain the images clearly worse than the best one.
std::vector<PartPoses> NotContradicted(std::vector<PartPoses> hypotheses, const Problem& problem,
                                       const std::vector<PlacingImage>& images) {
  if (hypotheses.size() < 2) return hypotheses;
  std::vector<double> misfits;
  for (const PartPoses& poses : hypotheses) misfits.push_back(MisfitOf(problem, poses, images));
  const double least = *std::min_element(misfits.begin(), misfits.end());
  std::vector<PartPoses> kept;
  for (size_t k = 0; k < misfits.size(); ++k) {
    if (misfits[k] <= least + kClearMisfit) kept.push_back(std::move(hypotheses[k]));
  }
  return kept;
}

// Returns the number of poses that a part has in the hypotheses.
int NumPoses(const Joining& joining, const CellPart& part) {
  constexpr double kSameM = 1e-3;
  constexpr double kSameRad = 0.01;
  std::vector<Rigid3d> poses;
  for (const PartPoses& hypothesis : joining.hypotheses) {
    const Rigid3d& pose = hypothesis.at(part);
    const bool is_known = std::any_of(poses.begin(), poses.end(), [&](const Rigid3d& other) {
      return DistanceM(pose, other) < kSameM && AngleRad(pose, other) < kSameRad;
    });
    if (!is_known) poses.push_back(pose);
  }
  return static_cast<int>(poses.size());
}

std::string NameOf(const Problem& problem, const CellPart& part) {
  if (part.kind == Kind::kCamera) return "camera " + problem.cameras[part.index].name;
  if (part.kind == Kind::kTarget) return "target " + problem.targets[part.index].name;
  return "arm " + problem.robots[part.index];
}

Failure WhyAmbiguous(const Problem& problem, const Joining& joining) {
  // The first one whose pose differs is the cause of the others.
  const auto cause =
      std::find_if(joining.ambiguous.begin(), joining.ambiguous.end(),
                   [&](const AmbiguousPart& ambiguous) { return NumPoses(joining, ambiguous.part) > 1; });
  CHECK(cause != joining.ambiguous.end());
  const ProblemTarget& target = problem.targets[cause->target];
  return Failure{
      FailureCode("ambiguous_part"),
      {{"poses", NumPoses(joining, cause->part)}, {"symmetries", static_cast<double>(target.symmetries.size())}},
      {{"part", NameOf(problem, cause->part)}, {"target", target.name}}};
}

// Returns a failure that names an arm that carries nothing, so that no image shows where it stands; nothing if all
// arms carry something.
std::optional<Failure> WhyArmNotJoined(const Problem& problem) {
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const Mount gripper{r, Mount::Part::kGripper};
    const auto is_on_it = [&](const auto& carried) { return carried.mount == gripper; };
    const bool carries = std::any_of(problem.cameras.begin(), problem.cameras.end(), is_on_it) ||
                         std::any_of(problem.targets.begin(), problem.targets.end(), is_on_it);
    if (carries) continue;
    return Failure{FailureCode("arm_carries_nothing"),
                   {{"arms", static_cast<double>(problem.robots.size())}},
                   {{"arm", problem.robots[r]}, {"mount", MountText(problem.robots, gripper)}}};
  }
  return std::nullopt;
}

// Returns whether the pose of a camera or a target in the world is known.
bool IsLocated(const PartPoses& placed, const CellPart& part, const Mount& mount) {
  return placed.contains(part) && (mount.part == Mount::Part::kBase || placed.contains(BasePart(mount.robot)));
}

// Returns the images that would join what is not located to the rest: those with something that is.
Failure::Names WhatWouldJoin(const Problem& problem, const PartPoses& placed) {
  Failure::Names names;
  constexpr size_t kMostNamed = 3;
  size_t num_named = 0;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    for (size_t t = 0; t < problem.targets.size() && num_named < kMostNamed; ++t) {
      const bool is_camera_located = IsLocated(placed, {Kind::kCamera, c}, problem.cameras[c].mount);
      if (is_camera_located == IsLocated(placed, {Kind::kTarget, t}, problem.targets[t].mount)) continue;
      names.emplace_back("of_camera", problem.cameras[c].name);
      names.emplace_back("of_target", problem.targets[t].name);
      ++num_named;
    }
  }
  return names;
}

Failure WhyNotJoined(const Problem& problem, const std::vector<CalibratedPair>& pairs,
                     const std::vector<PlacingImage>& images, const PartPoses& placed,
                     const std::vector<CellPart>& missing) {
  if (std::optional<Failure> reason = WhyArmNotJoined(problem)) return *std::move(reason);
  // The reason of a pair that would have joined one of them comes first.
  for (const CalibratedPair& pair : pairs) {
    std::vector<CellPart> unplaced = ImagesOfPair(pair, images).front().parts;
    std::erase_if(unplaced, [&](const CellPart& part) { return placed.contains(part); });
    if (unplaced.empty()) continue;
    const Failure::Numbers count = {{"images", pair.num_images}};
    Failure::Names names = {{"camera", problem.cameras[pair.camera].name},
                            {"target", problem.targets[pair.target].name}};
    if (unplaced.size() == 1) {
      names.emplace_back("part", NameOf(problem, unplaced.front()));
      return {FailureCode("pair_without_pose"), count, names};
    }
    const bool is_on_two_arms =
        !pair.robot && MovesAgainst(problem.cameras[pair.camera].mount, problem.targets[pair.target].mount);
    std::vector<Failure> why;
    if (is_on_two_arms) why = {FailureCode("on_two_arms")};
    if (pair.robot && !pair.calibration) why = {pair.calibration.failure()};
    if (pair.robot && pair.calibration && !pair.calibration->refined) why = {pair.calibration->refined.failure()};
    if (!why.empty()) return {FailureCode("pair_failed"), count, names, why};
  }
  Failure failure{FailureCode("not_joined")};
  for (const CellPart& part : missing) failure.names.emplace_back("part", NameOf(problem, part));
  for (auto& name : WhatWouldJoin(problem, placed)) failure.names.push_back(std::move(name));
  return failure;
}

// Returns the parts without a pose.
std::vector<CellPart> MissingParts(const Problem& problem, const PartPoses& placed) {
  std::vector<CellPart> parts;
  for (size_t c = 0; c < problem.cameras.size(); ++c) parts.push_back({Kind::kCamera, c});
  for (size_t t = 0; t < problem.targets.size(); ++t) parts.push_back({Kind::kTarget, t});
  for (size_t r = 1; r < problem.robots.size(); ++r) parts.push_back(BasePart(r));
  std::erase_if(parts, [&](const CellPart& part) { return placed.contains(part); });
  return parts;
}

// Returns the poses in the mounts, given those in the bodies.
CellPoses PosesInMounts(const Problem& problem, const PartPoses& placed) {
  CellPoses poses;
  for (size_t r = 0; r < problem.robots.size(); ++r) poses.world_from_base.push_back(placed.at(BasePart(r)));
  const auto mount_from = [&](const Mount& mount, const CellPart& part) {
    if (mount.part == Mount::Part::kGripper) return placed.at(part);
    return Inverse(poses.world_from_base[mount.robot]) * placed.at(part);
  };
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    poses.mount_from_camera.push_back(mount_from(problem.cameras[c].mount, {Kind::kCamera, c}));
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    poses.mount_from_target.push_back(mount_from(problem.targets[t].mount, {Kind::kTarget, t}));
  }
  return poses;
}

// Returns the name of a camera or target without images; nothing if all have some.
std::optional<Failure> WhyNotSeen(const Problem& problem) {
  std::vector<bool> camera_has(problem.cameras.size());
  std::vector<bool> target_has(problem.targets.size());
  for (const PlacingImage& image : PlacingImages(problem)) {
    camera_has[image.image->camera] = true;
    target_has[image.image->target] = true;
  }
  for (size_t c = 0; c < camera_has.size(); ++c) {
    if (camera_has[c]) continue;
    Failure failure{FailureCode("camera_without_target"), {}, {{"camera", problem.cameras[c].name}}};
    for (const ProblemTarget& target : problem.targets) failure.names.emplace_back("target", target.name);
    return failure;
  }
  for (size_t t = 0; t < target_has.size(); ++t) {
    if (!target_has[t]) return Failure{FailureCode("unseen_target"), {}, {{"target", problem.targets[t].name}}};
  }
  return std::nullopt;
}

// Returns the arm that moves a target against a camera; nothing if none or two do.
std::optional<size_t> MoverOf(const Problem& problem, size_t camera, size_t target) {
  std::vector<size_t> movers;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    if (IsMovedBy(problem.cameras[camera].mount, problem.targets[target].mount, r)) movers.push_back(r);
  }
  return movers.size() == 1 ? std::optional<size_t>(movers.front()) : std::nullopt;
}

// Returns the options of the calibration of a pair by itself, with the camera as the problem has it.
PairCalibrationOptions PairOptions(const Problem& problem, size_t camera, size_t target, LossKind loss) {
  PairCalibrationOptions single;
  const bool is_in_hand = problem.cameras[camera].mount.part == Mount::Part::kGripper;
  single.setup = is_in_hand ? Setup::kEyeInHand : Setup::kEyeToHand;
  single.shape = problem.targets[target].shape;
  single.symmetries = problem.targets[target].symmetries;
  single.bundle.free_intrinsics = problem.cameras[camera].free_intrinsics;
  single.bundle.loss = loss;
  return single;
}

// Estimates a camera of which the model is to be chosen too: with the target that an arm moves against it in most
// images, by the choice of a single camera, or from its images alone if there is none.
Outcome<Camera> ChooseCamera(const Problem& problem, size_t camera, const std::vector<View>& views, LossKind loss) {
  const Camera& size = problem.cameras[camera].camera;
  std::optional<size_t> best;
  std::vector<View> moved;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const std::optional<size_t> robot = MoverOf(problem, camera, t);
    if (!robot) continue;
    std::vector<View> of_target = ViewsOf(problem, camera, t, robot);
    if (of_target.size() <= moved.size()) continue;
    moved = std::move(of_target);
    best = t;
  }
  if (best) {
    PairCalibrationOptions single = PairOptions(problem, camera, *best, loss);
    single.choose_camera_model = true;
    single.width_px = size.width_px;
    single.height_px = size.height_px;
    Outcome<PairCalibration> calibration = CalibratePair(moved, single);
    if (calibration && calibration->refined) return calibration->camera;
  }
  Outcome<CameraChoice> choice = ChooseCameraModel(views, size.width_px, size.height_px);
  if (!choice) return choice.failure();
  return choice->camera;
}

}  // namespace

Outcome<std::vector<Camera>> EstimateCameras(const Problem& problem, const CalibrationOptions& options) {
  if (std::optional<Failure> unseen = WhyNotSeen(problem)) return *std::move(unseen);
  std::vector<Camera> cameras;
  std::vector<Failure> failures(problem.cameras.size());
  for (const ProblemCamera& camera : problem.cameras) cameras.push_back(camera.camera);
  ParallelFor(static_cast<int>(cameras.size()), options.adjustment.num_threads, [&](int index) {
    const auto c = static_cast<size_t>(index);
    if (!options.has_camera.empty() && options.has_camera[c]) return;
    std::vector<View> views;
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      for (View& view : ViewsOf(problem, c, t, std::nullopt)) views.push_back(std::move(view));
    }
    const Camera& known = problem.cameras[c].camera;
    const Outcome<Camera> camera = known.model.empty()
                                       ? ChooseCamera(problem, c, views, options.adjustment.loss)
                                       : EstimateIntrinsics(views, known.model, known.width_px, known.height_px);
    if (camera) cameras[c] = *camera;
    if (!camera) failures[c] = camera.failure();
  });
  for (size_t c = 0; c < failures.size(); ++c) {
    if (failures[c].empty()) continue;
    return Failure{FailureCode("of_camera"), {}, {{"camera", problem.cameras[c].name}}, {failures[c]}};
  }
  return cameras;
}

std::vector<CalibratedPair> CalibratePairs(const Problem& problem, const CalibrationOptions& options) {
  std::vector<CalibratedPair> pairs;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    for (size_t t = 0; t < problem.targets.size(); ++t) {
      CalibratedPair pair{c, t, std::nullopt};
      pair.robot = MoverOf(problem, c, t);
      pair.num_images = static_cast<int>(ViewsOf(problem, c, t, std::nullopt).size());
      if (pair.num_images > 0) pairs.push_back(std::move(pair));
    }
  }
  ParallelFor(static_cast<int>(pairs.size()), options.adjustment.num_threads, [&](int index) {
    CalibratedPair& pair = pairs[static_cast<size_t>(index)];
    if (!pair.robot) return;
    const ProblemCamera& camera = problem.cameras[pair.camera];
    PairCalibrationOptions single = PairOptions(problem, pair.camera, pair.target, options.adjustment.loss);
    single.camera = camera.camera;
    single.choose = {};
    single.bundle.camera_prior = camera.prior;
    const std::vector<View> views = ViewsOf(problem, pair.camera, pair.target, pair.robot);
    pair.calibration = CalibratePair(views, single);
    if (pair.calibration && pair.calibration->refined) return;
    // The images of one target may be too few to determine the camera.
    single.bundle.free_intrinsics.clear();
    single.bundle.camera_prior.reset();
    Outcome<PairCalibration> held = CalibratePair(views, single);
    if (held && held->refined) pair.calibration = std::move(held);
  });
  return pairs;
}

Outcome<CellPoses> JoinPairs(const Problem& problem, const std::vector<CalibratedPair>& pairs) {
  const std::vector<PlacingImage> images = PlacingImages(problem);
  std::vector<Edge> edges;
  for (const CalibratedPair& pair : pairs) {
    for (Edge& edge : EdgesOf(problem, pair, images)) edges.push_back(std::move(edge));
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& a, const Edge& b) { return a.variance_m2 < b.variance_m2; });
  Joining joining;
  PartPoses& origins = joining.hypotheses.emplace_back();
  origins[BasePart(0)] = Rigid3d();
  for (size_t r = 0; r < problem.robots.size(); ++r) origins[GripperPart(r)] = Rigid3d();
  // More hypotheses than these are not followed: nothing tells them apart.
  constexpr size_t kMostHypotheses = 64;
  while (joining.hypotheses.size() <= kMostHypotheses) {
    const PartPoses& placed = joining.hypotheses.front();
    const auto edge = std::find_if(edges.begin(), edges.end(),
                                   [&](const Edge& candidate) { return IsUsable(problem, placed, candidate); });
    if (edge != edges.end()) {
      joining = WithEdge(std::move(joining), *edge);
    } else {
      std::optional<Joining> next;
      for (const Placeable& part : PlaceableParts(problem, placed, images)) {
        next = WithPart(joining, problem, part);
        if (next) break;
      }
      if (!next) break;
      joining = *std::move(next);
    }
    joining.hypotheses = NotContradicted(std::move(joining.hypotheses), problem, images);
  }
  if (joining.hypotheses.size() > kMostHypotheses) return WhyAmbiguous(problem, joining);
  const PartPoses& placed = joining.hypotheses.front();
  const std::vector<CellPart> missing = MissingParts(problem, placed);
  if (!missing.empty()) return WhyNotJoined(problem, pairs, images, placed, missing);
  if (joining.hypotheses.size() > 1) return WhyAmbiguous(problem, joining);
  return PosesInMounts(problem, placed);
}

Problem InChosenOrders(Problem problem, const CellPoses& poses) {
  for (ProblemCapture& capture : problem.captures) {
    for (ProblemImage& image : capture.images) {
      if (!IsSymmetric(problem, image.target) || image.observations.size() == 0) continue;
      const Rigid3d predicted = CameraFromTarget(problem, poses, image.camera, image.target, capture.base_from_gripper);
      image.observations.points_in_target = BestReadingOrder(problem, image, predicted).points_in_target;
    }
  }
  return problem;
}

}  // namespace heba
