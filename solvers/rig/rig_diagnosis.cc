#include "solvers/rig/rig_diagnosis.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "heba/base/units.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"
#include "solvers/initial/usable_views.h"
#include "solvers/rig/rig_outliers.h"
#include "solvers/rig/rig_start.h"

namespace heba {
namespace {

// Fewer images cannot tell a fault of the camera from wrong images.
constexpr int kFewest = 6;

int NumUnused(const RigPair& pair) { return static_cast<int>(pair.calibration->unused.size()); }

bool IsCalibrated(const RigPair& pair) { return pair.calibration && pair.calibration->refined; }

bool IsSuspicious(const RigPair& pair) {
  constexpr double kManyUnused = 0.25;
  if (!pair.robot || pair.num_images < kFewest) return false;
  return !IsCalibrated(pair) || NumUnused(pair) > kManyUnused * pair.num_images;
}

// Returns the problem with the images of one camera only, each moved to the capture `shift` places later.
RigProblem Shifted(const RigProblem& problem, size_t camera, int shift) {
  RigProblem shifted = problem;
  for (RigCapture& capture : shifted.captures) capture.images.clear();
  const auto num_captures = static_cast<int>(problem.captures.size());
  for (int i = 0; i < num_captures; ++i) {
    const int to = i + shift;
    if (to < 0 || to >= num_captures) continue;
    for (const RigImage& image : problem.captures[static_cast<size_t>(i)].images) {
      if (image.camera == camera) shifted.captures[static_cast<size_t>(to)].images.push_back(image);
    }
  }
  return shifted;
}

}  // namespace

std::optional<ShiftedCamera> FindShiftedCamera(const RigProblem& problem, const std::vector<RigPair>& pairs,
                                               const RigCalibrationOptions& options) {
  std::set<size_t> cameras;
  for (const RigPair& pair : pairs) {
    if (IsSuspicious(pair)) cameras.insert(pair.camera);
  }
  for (const size_t camera : cameras) {
    for (const int shift : {-1, 1, -2, 2}) {
      int num_images = 0;
      int num_unused = 0;
      for (const RigPair& pair : CalibratePairs(Shifted(problem, camera, shift), options)) {
        if (!pair.robot) continue;
        num_images += pair.num_images;
        num_unused += IsCalibrated(pair) ? NumUnused(pair) : pair.num_images;
      }
      constexpr double kFewUnused = 0.1;
      if (num_images >= kFewest && num_unused <= kFewUnused * num_images) return ShiftedCamera{camera, shift};
    }
  }
  return std::nullopt;
}

std::vector<MovedCamera> FindMovedCameras(const RigProblem& problem, const RigCalibration& calibration) {
  std::vector<MovedCamera> moved;
  if (!calibration.refined) return moved;
  const RigSolution& solution = *calibration.refined;
  const std::vector<RigCapture> used = WithoutRejected(calibration.problem, solution).captures;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    // The pose of the camera according to each image that is left out, in its pose according to the solution.
    std::vector<size_t> left_out;
    std::vector<size_t> kept;
    std::vector<Rigid3d> motions;
    for (size_t i = 0; i < problem.captures.size(); ++i) {
      for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
        const RigImage& image = problem.captures[i].images[k];
        if (image.camera != c || image.observations.size() == 0) continue;
        // Fewer points may fit by chance.
        if (used[i].images[k].observations.size() >= kMinPosePoints) {
          if (kept.empty() || kept.back() != i) kept.push_back(i);
          continue;
        }
        const Rigid3d predicted =
            CameraFromTarget(problem, solution.poses, c, image.target, WithErrors(used[i], solution.effects));
        const std::vector<TargetPose> poses =
            EstimateTargetPose(solution.cameras[c], ApplyShape(image.observations, solution.shapes[image.target]));
        const TargetPose* const seen = NearestPose(poses, predicted);
        if (seen == nullptr) continue;
        if (left_out.empty() || left_out.back() != i) left_out.push_back(i);
        motions.push_back(predicted * Inverse(seen->camera_from_target));
      }
    }
    if (static_cast<int>(motions.size()) < kFewest || kept.empty()) continue;
    // All of them lie after the others, or before.
    const bool is_after = left_out.front() > kept.back();
    const bool is_before = left_out.back() < kept.front();
    if (!is_after && !is_before) continue;
    const Rigid3d mean = MeanPose(motions);
    double scatter_m2 = 0;
    double scatter_rad2 = 0;
    for (const Rigid3d& motion : motions) {
      scatter_m2 += std::pow(DistanceM(motion, mean), 2);
      scatter_rad2 += std::pow(AngleRad(motion, mean), 2);
    }
    // The motion is larger than its scatter, which is that of poses from single images.
    const auto count = static_cast<double>(motions.size());
    const double ratio = std::max(mean.translation.norm() / std::sqrt(scatter_m2 / count),
                                  RotationAngle(mean.rotation) / std::sqrt(scatter_rad2 / count));
    constexpr double kClear = 2;
    if (!(ratio > kClear)) continue;
    moved.push_back(is_after ? MovedCamera{c, left_out.front(), kept.back(), mean}
                             : MovedCamera{c, kept.front(), left_out.back(), Inverse(mean)});
  }
  return moved;
}

}  // namespace heba
