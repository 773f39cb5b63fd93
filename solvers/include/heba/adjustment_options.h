// The options of an adjustment: what is free, the noise, the loss.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/camera_prior.h"
#include "heba/data/loss_kind.h"
#include "heba/data/pair_solution.h"
#include "heba/data/scale_sigmas.h"

namespace heba {

struct JointPrior;  // heba/data/joint_prior.h

// The options of the adjustment of a problem with any number of cameras, targets and arms, which says itself what is
// free.
struct AdjustmentOptions {
  LossKind loss = LossKind::kTruncated;
  // Sigma of one coordinate of every camera, px. Nothing: estimated from the residuals, for each camera.
  std::optional<double> pixel_noise_px;
  // Initial guess of that sigma if it is estimated, greater than zero, one per camera; a truncated loss does not use
  // it. Empty: by the median of the residuals.
  std::vector<double> pixel_noise_start_px;
  // Treats the poses of the arms as exact, as observations with the given noise, or as observations with a noise that
  // is estimated, for each arm by itself, together with the pixel noise (by restricted maximum likelihood).
  enum class Robot { kExact, kGivenNoise, kEstimatedNoise };
  Robot robot = Robot::kEstimatedNoise;
  RobotNoise robot_noise;  // Used with kGivenNoise, for all arms.
  // Used with kEstimatedNoise: prior of the robot noise, for captures that are too few to determine it.
  std::optional<RobotNoisePrior> robot_noise_prior;
  // Used with kEstimatedNoise: initial guess of the robot noise. The default is an inaccurate robot.
  RobotNoise robot_noise_start = {1e-3, 2e-3, 1e-3};
  // Whether the standard deviations of the groups of systematic errors, and those of each capture's noise beside them,
  // are kept away from zero, which few effects and captures cannot prove (solvers/uncertainty/variance_components.h,
  // VarianceGroup::avoids_zero). Models are compared without that.
  bool effects_avoid_zero = true;
  int max_iterations = 200;
  int num_threads = 1;  // The result does not depend on it.

  // Returns every violated constraint, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// The options of the adjustment of one camera, one target and one arm, with what is free. The arm is exact unless it is
// said to have noise.
struct BundleOptions : AdjustmentOptions {
  BundleOptions() { robot = Robot::kExact; }

  std::vector<ParameterGroup> free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                 ParameterGroup::kDistortion};
  // The unknown parts of the target's shape; PairProblem::shape is the initial guess.
  std::vector<TargetShapeGroup> free_shape;
  // The systematic errors of the robot that are estimated (View::effect); null: none. The standard deviations of their
  // groups are estimated too with kEstimatedNoise, and given otherwise.
  std::shared_ptr<const SharedEffects> effects;
  // Is treated as an additional measurement of the free camera parameters.
  std::optional<CameraPrior> camera_prior;
  // One sigma of the target's scales about 1 (TargetShape), as additional measurements; nothing: they are not known.
  // The scale of the target and the size of an arm have nearly the same effect on the images.
  std::optional<double> target_scale_sigma;
  double known_target_scale_sigma = kTargetScaleSigma;  // ProblemTarget::known_scale_sigma.
  std::shared_ptr<const JointPrior> prior;              // Problem::prior.
};

}  // namespace heba
