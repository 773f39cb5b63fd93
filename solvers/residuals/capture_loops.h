// The adjustment of a problem's captures as an adjustment of kinematic loops (solvers/residuals/loop_problem.h).
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/data/unknowns.h"
#include "solvers/residuals/loop_problem.h"

namespace heba {

// The values of a problem's unknowns.
struct FitState {
  CellPoses poses;
  std::vector<Camera> cameras;
  std::vector<TargetShape> shapes;
  // The corrections of the arms' poses: for each capture, one for each arm; empty if the arms are exact.
  std::vector<std::vector<Rigid3d>> corrections;
  std::vector<Eigen::VectorXd> effects;  // Solution::effects.
};

// The noise that the residuals are whitened with.
struct FitNoise {
  std::vector<double> pixel_px;  // One per camera.
  // One per camera: the sigma of an error of each image as a whole, which acts like another pose of the target; it
  // moves each point by as much (RMS).
  std::vector<double> image_px;
  std::vector<RobotNoise> robots;  // One per moving arm (MovingRobots); empty if the arms are exact.
  std::vector<std::vector<double>> effect_sigmas = {};  // Solution::effect_sigmas.
};

// Returns the arms that move a target against a camera in at least one image, in ascending order. Only their noise can
// be seen.
std::vector<size_t> MovingRobots(const Problem& problem);

// Returns, for each of these arms, the number of joints whose noise is part of the arm's noise.
std::vector<Eigen::Index> NoisyJointsOf(const Problem& problem, const std::vector<size_t>& moving);

// Returns the captures with points, in ascending order.
std::vector<size_t> CapturesWithPoints(const Problem& problem);

// The captures with points, as indices: those of one group were taken at one pose of every moving arm, and in one
// posture if the joints are known, and share their corrections.
using CaptureGroups = std::vector<std::vector<size_t>>;
CaptureGroups GroupByRobotPoses(const Problem& problem);

// An image: the index of its capture, and its index in ProblemCapture::images.
struct ImageIndex {
  size_t capture = 0;
  size_t image = 0;
  bool operator==(const ImageIndex& other) const = default;
};
// Returns the images with points, in the order of the views of CaptureLoops.
std::vector<ImageIndex> ImagesOf(const Problem& problem, const CaptureGroups& groups);

// Returns the variance, in whitened units, of each direction of an image's rows that another pose of the target would
// explain, for an error of the image as a whole that moves each coordinate of its points by `sigma_px` (RMS).
double PoseErrorVariance(double sigma_px, double pixel_sigma_px, int num_points);
// Returns LoopView::pose_variance_ratio of an image, which must have points.
double PoseVarianceRatio(const FitNoise& noise, const ProblemImage& image);

// Returns the loops of the groups. With `has_corrections`, the nuisance poses of a capture are the corrections of the
// moving arms, zero if the arms of the state are exact, and their priors are the noise of the arms if there is any. The
// problem must outlive the result.
LoopProblem CaptureLoops(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                         const FitNoise& noise, bool has_corrections);
// Likewise, with one capture for each image, in the order of ImagesOf. Its nuisance poses are zero if the arms are
// exact. `moving` are the arms that have corrections.
LoopProblem ImageLoops(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                       const FitNoise& noise, const std::vector<size_t>& moving);

// Returns the values of the loops' unknowns, and the state with other values and the same corrections.
LoopValues ValuesOf(const FitState& state);
FitState WithValues(FitState state, const LoopValues& values);

// Returns camera_from_target of an image, with the errors and the corrections of its capture.
Rigid3d PredictedPose(const Problem& problem, const FitState& state, const ImageIndex& index);

}  // namespace heba
