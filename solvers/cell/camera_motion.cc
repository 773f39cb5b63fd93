#include "solvers/cell/camera_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/median.h"
#include "heba/base/units.h"
#include "heba/data/target_shape.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kSize = 6;  // Coordinates of a pose.
// Fewer images of a part cannot tell a motion from wrong images.
constexpr size_t kFewest = 4;
// A motion is clear if it is so many times as large as what it is compared with.
constexpr double kClear = 3;

// The pose of a camera according to one of its images: the tangent (m, rad) from its pose in the solution.
struct Displacement {
  size_t capture = 0;
  Tangent6 tangent;
};

// Returns the displacements of a camera, in the order of the captures.
std::vector<Displacement> DisplacementsOf(const Problem& problem, const Solution& solution, size_t camera) {
  std::vector<Displacement> displacements;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const ProblemCapture& capture = problem.captures[i];
    for (const ProblemImage& image : capture.images) {
      if (image.camera != camera || image.observations.size() == 0) continue;
      const Rigid3d predicted =
          CameraFromTarget(problem, solution.poses, camera, image.target, WithErrors(capture, solution.effects));
      const std::vector<TargetPose> poses =
          EstimateTargetPose(solution.cameras[camera], ApplyShape(image.observations, solution.shapes[image.target]));
      const TargetPose* const seen = NearestPose(poses, predicted);
      if (seen == nullptr) continue;
      displacements.push_back({i, LocalCoordinates(Rigid3d(), predicted * Inverse(seen->camera_from_target))});
    }
  }
  return displacements;
}

// Returns the tangents of [first, last) without those that are far from the others.
std::vector<Tangent6> InliersOf(const std::vector<Displacement>& all, size_t first, size_t last) {
  Tangent6 middle;
  Tangent6 scale;
  for (Eigen::Index c = 0; c < 6; ++c) {
    std::vector<double> values;
    for (size_t i = first; i < last; ++i) values.push_back(all[i].tangent[c]);
    middle[c] = Median(values);
    for (double& value : values) value = std::abs(value - middle[c]);
    scale[c] = Median(values) / 0.6745;  // The standard deviation of normal numbers.
  }
  constexpr double kFar = 10;
  std::vector<Tangent6> inliers;
  for (size_t i = first; i < last; ++i) {
    const Tangent6 from_middle = (all[i].tangent - middle).cwiseAbs();
    if ((from_middle.array() <= kFar * scale.array()).all()) inliers.push_back(all[i].tangent);
  }
  return inliers;
}

struct Mean {
  Tangent6 value = Tangent6::Zero();
  Matrix6 squares = Matrix6::Zero();  // Sum of the squared deviations.
  double count = 0;
};

Mean MeanOf(const std::vector<Tangent6>& tangents) {
  Mean mean;
  mean.count = static_cast<double>(tangents.size());
  for (const Tangent6& tangent : tangents) mean.value += tangent / mean.count;
  for (const Tangent6& tangent : tangents) {
    mean.squares += (tangent - mean.value) * (tangent - mean.value).transpose();
  }
  return mean;
}

// A capture from which on a camera may have another pose.
struct Jump {
  size_t camera = 0;
  size_t last_capture = 0;
  size_t first_capture = 0;
  Tangent6 before;  // Means of the displacements.
  Tangent6 after;
  double p_value = 1;
};

// Returns the place of the first displacement of the second part: every displacement is near the mean of its part.
size_t PlaceOf(const std::vector<Displacement>& all, const Mean& before, const Mean& after, const Matrix6& scatter) {
  const Matrix6 inverse = InverseOfSymmetric(scatter);
  const auto cost = [&](const Displacement& displacement, const Mean& mean) {
    constexpr double kMost = 50;  // Wrong images count alike in both parts.
    const Tangent6 from_mean = displacement.tangent - mean.value;
    return std::min(kMost, from_mean.dot(inverse * from_mean));
  };
  double sum = 0;
  double least = 0;
  size_t place = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    sum += cost(all[i], before) - cost(all[i], after);
    if (sum >= least) continue;
    least = sum;
    place = i + 1;
  }
  return place;
}

// Returns the jump of a camera that is least likely by chance; nothing if all are likely, or within the scatter.
std::optional<Jump> ClearestJump(const Problem& problem, const Solution& solution, size_t camera) {
  const std::vector<Displacement> all = DisplacementsOf(problem, solution, camera);
  std::optional<Jump> clearest;
  // At most 200 places are tried, evenly chosen.
  const size_t step = std::max<size_t>(1, all.size() / 200);
  for (size_t k = kFewest; k + kFewest <= all.size(); k += step) {
    if (all[k].capture == all[k - 1].capture) continue;
    const Mean before = MeanOf(InliersOf(all, 0, k));
    const Mean after = MeanOf(InliersOf(all, k, all.size()));
    const double count = before.count + after.count;
    if (before.count < kFewest || after.count < kFewest || count < kSize + 4) continue;
    const Matrix6 scatter = (before.squares + after.squares) / (count - 2);
    const Tangent6 difference = after.value - before.value;
    const double distance2 = MahalanobisSquare(difference, scatter);
    if (!(distance2 > kClear * kClear)) continue;
    const double t2 = before.count * after.count / count * distance2;
    const double dof = count - kSize - 1;
    const double p_value = FisherTail(t2 * dof / (kSize * (count - 2)), kSize, dof);
    constexpr double kLevel = 1e-4;
    if (p_value * static_cast<double>(all.size()) > kLevel) continue;
    if (clearest && p_value >= clearest->p_value) continue;
    const size_t place = PlaceOf(all, before, after, scatter);
    if (place < kFewest || place + kFewest > all.size()) continue;
    clearest = Jump{camera, all[place - 1].capture, all[place].capture, before.value, after.value, p_value};
    // A motion between two images of one capture counts as one after it.
    if (clearest->last_capture == clearest->first_capture) ++clearest->first_capture;
  }
  return clearest;
}

// Returns the rig with another camera for the images from the jump on.
Problem Split(Problem problem, const Jump& jump) {
  ProblemCamera after = problem.cameras[jump.camera];
  after.name += " after the motion";
  const size_t camera = problem.cameras.size();
  problem.cameras.push_back(std::move(after));
  for (size_t i = jump.first_capture; i < problem.captures.size(); ++i) {
    for (ProblemImage& image : problem.captures[i].images) {
      if (image.camera == jump.camera) image.camera = camera;
    }
  }
  return problem;
}

// Returns the split rig whose two cameras have these intrinsics, which are held.
Problem WithHeldIntrinsics(Problem split, const Jump& jump, const Camera& camera) {
  for (ProblemCamera* const part : {&split.cameras[jump.camera], &split.cameras.back()}) {
    part->camera = camera;
    part->free_intrinsics.clear();
  }
  return split;
}

int NumImagesOf(const Problem& problem, size_t camera) {
  return CountImages(problem, [&](const ProblemImage& image) { return image.camera == camera; });
}

// Returns the pose of the second camera of a split rig in the first one, if the images agree with it: few of either
// camera are left out.
std::optional<RelativePose> MotionOf(const Problem& split, const JudgedProblem& judged, const Jump& jump) {
  const size_t after = split.cameras.size() - 1;
  for (const size_t camera : {jump.camera, after}) {
    int num_left_out = 0;
    for (const auto& [i, k] : judged.left_out) num_left_out += split.captures[i].images[k].camera == camera ? 1 : 0;
    constexpr double kFew = 0.25;
    if (num_left_out > kFew * NumImagesOf(split, camera)) return std::nullopt;
  }
  for (const RelativePose& pose : RelativeCameraPoses(split, judged.solution)) {
    if (pose.parent == split.cameras[jump.camera].name && pose.child == split.cameras[after].name) return pose;
  }
  return std::nullopt;
}

// Returns the jump with the captures beside it on the other side if their images contradict those of their side.
Jump Corrected(const Problem& problem, const ImageSet& left_out, Jump jump) {
  // The captures with images of the camera, and whether all of these contradict the others.
  std::vector<std::pair<size_t, bool>> captures;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    int num_images = 0;
    int num_left_out = 0;
    for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
      const ProblemImage& image = problem.captures[i].images[k];
      if (image.camera != jump.camera || image.observations.size() == 0) continue;
      ++num_images;
      num_left_out += left_out.contains({i, k}) ? 1 : 0;
    }
    if (num_images > 0) captures.emplace_back(i, num_left_out == num_images);
  }
  size_t first = 0;
  while (first < captures.size() && captures[first].first < jump.first_capture) ++first;
  size_t corrected = first;
  while (corrected > 1 && captures[corrected - 1].second) --corrected;
  while (corrected == first && first + 1 < captures.size() && captures[first].second) corrected = ++first;
  jump.last_capture = captures[corrected - 1].first;
  jump.first_capture = captures[corrected].first;
  return jump;
}

// Returns the captures with images of the camera before the jump, or those from it on if these are not more.
std::vector<size_t> ShorterPart(const Problem& problem, const Jump& jump) {
  std::vector<size_t> before;
  std::vector<size_t> after;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const std::vector<ProblemImage>& images = problem.captures[i].images;
    const bool is_seen = std::any_of(images.begin(), images.end(), [&](const ProblemImage& image) {
      return image.camera == jump.camera && image.observations.size() > 0;
    });
    if (is_seen) (i < jump.first_capture ? before : after).push_back(i);
  }
  return after.size() <= before.size() ? after : before;
}

// Returns whether a motion exceeds what the errors of the arms do to single captures, by far: a smaller one may be such
// errors, of captures that were taken one after another in one region.
bool IsBeyondArms(const Rigid3d& motion, const Problem& problem, const Solution& solution) {
  RobotNoise noise;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const RobotNoise of_arm = NoiseElsewhere(solution, r);
    noise.translation_m = std::max(noise.translation_m, of_arm.translation_m);
    noise.rotation_rad = std::max(noise.rotation_rad, of_arm.rotation_rad);
  }
  return motion.translation.norm() > kClear * noise.translation_m ||
         RotationAngle(motion.rotation) > kClear * noise.rotation_rad;
}

// Returns the motion if an adjustment with two cameras confirms the jump.
std::optional<MovedCamera> Confirmed(const Problem& problem, const JudgedProblem& judged, const Jump& found,
                                     const AdjustmentOptions& options) {
  Jump jump = found;
  CellPoses start = judged.solution.poses;
  const Rigid3d mount_from_camera = start.mount_from_camera[jump.camera];
  start.mount_from_camera[jump.camera] = Retract(mount_from_camera, jump.before);
  start.mount_from_camera.push_back(Retract(mount_from_camera, jump.after));
  const ImageSet left_out = ImagesOfOthers(problem, judged.left_out, jump.camera);
  // Both cameras have intrinsics of their own, so that errors of the lens are no motion.
  Problem split = Split(problem, jump);
  Outcome<JudgedProblem> two = RefineWithoutOutliers(split, start, left_out, options);
  if (!two) {
    // The images of a part may be too few for that.
    split = WithHeldIntrinsics(std::move(split), jump, judged.solution.cameras[jump.camera]);
    two = RefineWithoutOutliers(split, start, left_out, options);
  }
  if (!two) return std::nullopt;
  std::optional<RelativePose> pose = MotionOf(split, *two, jump);
  if (!pose) return std::nullopt;
  const Tangent6 motion = LocalCoordinates(Rigid3d(), pose->parent_from_child);
  const double statistic = MahalanobisSquare(motion, pose->covariance) / kSize;
  constexpr double kLevel = 1e-6;
  if (FisherTail(statistic, kSize, two->solution.covariance_dof) > kLevel) return std::nullopt;
  if (!IsBeyondArms(pose->parent_from_child, split, two->solution)) return std::nullopt;
  // Its size is measured with the lens of the longer part, because two lenses take up a part of the motion.
  const size_t after = split.cameras.size() - 1;
  const size_t longer = NumImagesOf(split, jump.camera) >= NumImagesOf(split, after) ? jump.camera : after;
  jump = Corrected(problem, two->left_out, jump);
  const Problem held = WithHeldIntrinsics(Split(problem, jump), jump, two->solution.cameras[longer]);
  const Outcome<JudgedProblem> measured = RefineWithoutOutliers(held, two->solution.poses, left_out, options);
  if (measured) {
    if (const std::optional<RelativePose> better = MotionOf(held, *measured, jump)) pose = better;
  }
  return MovedCamera{jump.camera, jump.last_capture, jump.first_capture, pose->parent_from_child,
                     ShorterPart(problem, jump)};
}

}  // namespace

std::optional<MovedCamera> FindMovedCamera(const Problem& problem, const JudgedProblem& judged,
                                           const AdjustmentOptions& options) {
  std::vector<Jump> jumps;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (const std::optional<Jump> jump = ClearestJump(problem, judged.solution, c)) jumps.push_back(*jump);
  }
  std::sort(jumps.begin(), jumps.end(), [](const Jump& a, const Jump& b) { return a.p_value < b.p_value; });
  for (const Jump& jump : jumps) {
    if (std::optional<MovedCamera> moved = Confirmed(problem, judged, jump, options)) return moved;
  }
  return std::nullopt;
}

std::string WhyLeftOut(const Problem& problem, const MovedCamera& moved) {
  const bool is_after = moved.left_out.front() >= moved.first_capture;
  return std::string("the camera was moved ") + (is_after ? "before" : "afterwards") + ", between the captures " +
         problem.captures[moved.last_capture].name + " and " + problem.captures[moved.first_capture].name;
}

Finding DescribeMotion(const Problem& problem, const MovedCamera& moved) {
  Finding finding{Grade::kBad,
                  FindingCode("camera_moved"),
                  {{"moved_mm", 1000 * moved.before_from_after.translation.norm()},
                   {"moved_deg", RadToDeg(RotationAngle(moved.before_from_after.rotation))},
                   {"images_left_out", static_cast<double>(moved.left_out.size())}},
                  {{"camera", problem.cameras[moved.camera].name},
                   {"last_capture", problem.captures[moved.last_capture].name},
                   {"first_capture", problem.captures[moved.first_capture].name},
                   {"first_left_out", problem.captures[moved.left_out.front()].name},
                   {"last_left_out", problem.captures[moved.left_out.back()].name}}};
  finding.is_cause = true;
  return finding;
}

}  // namespace heba
