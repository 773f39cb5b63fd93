#include "solvers/rig/rig_camera_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "heba/base/distributions.h"
#include "heba/data/target_shape.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kSize = 6;  // Coordinates of a pose.
// Fewer images of a part cannot tell a motion from wrong images.
constexpr size_t kFewest = 4;

// The pose of a camera according to one of its images: the tangent (m, rad) from its pose in the solution.
struct Displacement {
  size_t capture = 0;
  Tangent6 tangent;
};

// Returns the displacements of a camera, in the order of the captures.
std::vector<Displacement> DisplacementsOf(const RigProblem& problem, const RigSolution& solution, size_t camera) {
  std::vector<Displacement> displacements;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const RigCapture& capture = problem.captures[i];
    for (const RigImage& image : capture.images) {
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

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Returns the tangents of [first, last) without those that are far from the others.
std::vector<Tangent6> InliersOf(const std::vector<Displacement>& all, size_t first, size_t last) {
  Tangent6 middle;
  Tangent6 scale;
  for (Eigen::Index c = 0; c < 6; ++c) {
    std::vector<double> values;
    for (size_t i = first; i < last; ++i) values.push_back(all[i].tangent[c]);
    middle[c] = MedianOf(values);
    for (double& value : values) value = std::abs(value - middle[c]);
    scale[c] = MedianOf(values) / 0.6745;  // The standard deviation of normal numbers.
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

// Returns the jump of a camera that is unlikely by chance and leaves the fewest images far from the others of their
// part; nothing if all are likely, or within the scatter.
std::optional<Jump> ClearestJump(const RigProblem& problem, const RigSolution& solution, size_t camera) {
  const std::vector<Displacement> all = DisplacementsOf(problem, solution, camera);
  std::optional<Jump> clearest;
  double most_near = 0;
  // Of many captures, some are tried.
  const size_t step = std::max<size_t>(1, all.size() / 200);
  for (size_t k = kFewest; k + kFewest <= all.size(); k += step) {
    if (all[k].capture == all[k - 1].capture) continue;
    const Mean before = MeanOf(InliersOf(all, 0, k));
    const Mean after = MeanOf(InliersOf(all, k, all.size()));
    const double count = before.count + after.count;
    if (before.count < kFewest || after.count < kFewest || count < kSize + 4) continue;
    const Matrix6 scatter = (before.squares + after.squares) / (count - 2);
    const Tangent6 difference = after.value - before.value;
    const double distance2 = difference.dot(scatter.ldlt().solve(difference));
    constexpr double kClear = 3;
    if (!(distance2 > kClear * kClear)) continue;
    const double t2 = before.count * after.count / count * distance2;
    const double dof = count - kSize - 1;
    const double p_value = FisherTail(t2 * dof / (kSize * (count - 2)), kSize, dof);
    constexpr double kLevel = 1e-4;
    if (p_value * static_cast<double>(all.size()) > kLevel) continue;
    const bool is_clearer = !clearest || count > most_near || (count == most_near && p_value < clearest->p_value);
    if (!is_clearer) continue;
    most_near = count;
    clearest = Jump{camera, all[k - 1].capture, all[k].capture, before.value, after.value, p_value};
  }
  return clearest;
}

// Returns the rig with another camera for the images from the jump on.
RigProblem Split(RigProblem problem, const Jump& jump, const std::vector<ParameterGroup>& free_intrinsics) {
  problem.cameras[jump.camera].free_intrinsics = free_intrinsics;
  RigCamera after = problem.cameras[jump.camera];
  after.name += " after the motion";
  const size_t camera = problem.cameras.size();
  problem.cameras.push_back(std::move(after));
  for (size_t i = jump.first_capture; i < problem.captures.size(); ++i) {
    for (RigImage& image : problem.captures[i].images) {
      if (image.camera == jump.camera) image.camera = camera;
    }
  }
  return problem;
}

// Returns the share of a camera's images with points that are left out.
double ShareLeftOut(const RigProblem& problem, const ImageSet& left_out, size_t camera) {
  double num_images = 0;
  double num_left_out = 0;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
      const RigImage& image = problem.captures[i].images[k];
      if (image.camera != camera || image.observations.size() == 0) continue;
      ++num_images;
      num_left_out += left_out.contains({i, k}) ? 1 : 0;
    }
  }
  return num_left_out / std::max(1.0, num_images);
}

// Returns the motion if an adjustment with two cameras confirms the jump.
std::optional<MovedCamera> Confirmed(const RigProblem& problem, const JudgedRig& judged, const Jump& jump,
                                     const RigOptions& options) {
  RigPoses start = judged.solution.poses;
  const Rigid3d mount_from_camera = start.mount_from_camera[jump.camera];
  start.mount_from_camera[jump.camera] = Retract(mount_from_camera, jump.before);
  start.mount_from_camera.push_back(Retract(mount_from_camera, jump.after));
  const ImageSet left_out = ImagesOfOthers(problem, judged.left_out, jump.camera);
  const RigCamera& camera = problem.cameras[jump.camera];
  // Few images of a part may not tell its intrinsics, which are then held.
  std::vector<std::vector<ParameterGroup>> choices = {camera.free_intrinsics};
  if (!camera.free_intrinsics.empty()) choices.emplace_back();
  for (const std::vector<ParameterGroup>& free_intrinsics : choices) {
    RigProblem split = Split(problem, jump, free_intrinsics);
    if (free_intrinsics.empty()) {
      split.cameras[jump.camera].camera = judged.solution.cameras[jump.camera];
      split.cameras.back().camera = judged.solution.cameras[jump.camera];
    }
    const Outcome<JudgedRig> two = RefineWithoutOutliers(split, start, left_out, options);
    if (!two) continue;
    constexpr double kFew = 0.25;
    if (ShareLeftOut(split, two->left_out, jump.camera) > kFew) return std::nullopt;
    if (ShareLeftOut(split, two->left_out, split.cameras.size() - 1) > kFew) return std::nullopt;
    for (const RelativePose& pose : RelativeCameraPoses(split, two->solution)) {
      if (pose.parent != camera.name || pose.child != split.cameras.back().name) continue;
      const Tangent6 motion = LocalCoordinates(Rigid3d(), pose.parent_from_child);
      const double statistic = motion.dot(pose.covariance.ldlt().solve(motion)) / kSize;
      constexpr double kLevel = 1e-6;
      if (FisherTail(statistic, kSize, two->solution.covariance_dof) > kLevel) return std::nullopt;
      return MovedCamera{jump.camera, jump.last_capture, jump.first_capture, pose.parent_from_child};
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<MovedCamera> FindMovedCamera(const RigProblem& problem, const JudgedRig& judged,
                                           const RigOptions& options) {
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

}  // namespace heba
