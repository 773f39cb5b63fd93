// The adjustment of a rig as an adjustment of kinematic loops (solvers/residuals/loop_problem.h).
#pragma once

#include <vector>

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/data/unknowns.h"
#include "solvers/residuals/loop_problem.h"

namespace heba {

// The values of a rig's unknowns.
struct RigState {
  RigPoses poses;
  std::vector<Camera> cameras;
  std::vector<TargetShape> shapes;
  // The corrections of the arms' poses: for each capture, one for each arm; empty if the arms are exact.
  std::vector<std::vector<Rigid3d>> corrections;
  std::vector<Eigen::VectorXd> effects;  // RigSolution::effects.
};

// The noise that the residuals are whitened with.
struct RigNoise {
  std::vector<double> pixel_px;  // One per camera.
  // One per camera: the sigma of an error of each image as a whole, which acts like another pose of the target; it
  // moves each point by as much (RMS).
  std::vector<double> image_px;
  std::vector<RobotNoise> robots;  // One per moving arm (MovingRobots); empty if the arms are exact.
  std::vector<std::vector<double>> effect_sigmas = {};  // RigSolution::effect_sigmas.
};

// Returns the arms that move a target against a camera in at least one image, in ascending order. Only their noise can
// be seen.
std::vector<size_t> MovingRobots(const RigProblem& problem);

// The captures with points, as indices: those of one group were taken at one pose of every moving arm, and share their
// corrections.
using CaptureGroups = std::vector<std::vector<size_t>>;
CaptureGroups GroupByRobotPoses(const RigProblem& problem);

// An image of a rig: the index of its capture, and its index in RigCapture::images.
struct ImageIndex {
  size_t capture = 0;
  size_t image = 0;
  bool operator==(const ImageIndex& other) const = default;
};
// Returns the images with points, in the order of the views of RigLoops.
std::vector<ImageIndex> ImagesOf(const RigProblem& problem, const CaptureGroups& groups);

// Returns the variance, in whitened units, of each direction of an image's rows that another pose of the target would
// explain, for an error of the image as a whole that moves each coordinate of its points by `sigma_px` (RMS).
double PoseErrorVariance(double sigma_px, double pixel_sigma_px, int num_points);
// Returns LoopView::pose_variance_ratio of an image, which must have points.
double PoseVarianceRatio(const RigNoise& noise, const RigImage& image);

// Returns the loops of the groups. With corrections, the own poses of a capture are those of the moving arms; their
// priors are the robot noise. The problem must outlive the result.
LoopProblem RigLoops(const RigProblem& problem, const CaptureGroups& groups, const RigState& state,
                     const RigNoise& noise);
// Likewise, with one capture for each image, in the order of ImagesOf. Its own poses are zero if the arms are exact.
// `moving` are the arms that have corrections.
LoopProblem RigImageLoops(const RigProblem& problem, const CaptureGroups& groups, const RigState& state,
                          const RigNoise& noise, const std::vector<size_t>& moving);

// Returns the values of the loops' unknowns, and the state with other values and the same corrections.
LoopValues RigValues(const RigState& state);
RigState WithValues(RigState state, const LoopValues& values);

// Returns camera_from_target of an image, with the errors and the corrections of its capture.
Rigid3d PredictedPose(const RigProblem& problem, const RigState& state, const ImageIndex& index);

}  // namespace heba
