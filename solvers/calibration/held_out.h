// The errors of an estimate on images that it was not estimated from.
#pragma once

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/evaluation/metrics.h"
#include "solvers/initial/target_pose.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// Held-out images add up to this.
struct HeldOutErrors {
  SquaredErrors pixels;
  bool has_hidden = false;  // Whether a point of an image has none at its predicted pose; `pixels` is without it.
  // The distances and angles between the predicted pose of the target and the pose that its own image shows.
  double sum_m2 = 0;
  double sum_rad2 = 0;
  int num_poses = 0;
  std::vector<std::pair<size_t, double>> distance_m_of_capture;

  void Add(const HeldOutErrors& other);
  // Adds the image of a capture. `predicted` is camera_from_target; the points are as manufactured, and `poses` are
  // those that they show by themselves (EstimateTargetPose).
  void AddImage(const Camera& camera, const Rigid3d& predicted, const Observations& points,
                const std::vector<TargetPose>& poses, size_t capture);
  // Returns the RMS of the distances (m) and of the angles (rad); nothing without poses.
  std::optional<double> RmsDistanceM() const;
  std::optional<double> RmsAngleRad() const;
};

// Returns the errors of the images of one camera that a solution of the problem did not use.
HeldOutErrors ErrorsOfUnused(const Problem& problem, const Solution& solution, const ImageSet& images, size_t camera);

// The squared residuals of held-out images in units of their noise, and their number.
struct SumOfSquares {
  double squares = 0;
  double number = 0;

  void Add(const SumOfSquares& other);
  // Returns the mean, which is about 1 if the model is right; nothing without residuals.
  std::optional<double> Mean() const;
};
// Returns those of the images with points, whitened by the noise of the solution: that of pixels, images and arms and,
// if `has_covariance`, the covariance of the estimate. They are zero if a point cannot be projected.
SumOfSquares SquaresOf(const Problem& held_out, const Solution& solution, bool has_covariance);

}  // namespace heba
