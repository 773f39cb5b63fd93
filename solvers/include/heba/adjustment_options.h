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

struct BundleOptions {
  std::vector<ParameterGroup> free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                 ParameterGroup::kDistortion};
  // The unknown parts of the target's shape; PairProblem::shape is the initial guess.
  std::vector<TargetShapeGroup> free_shape;
  LossKind loss = LossKind::kTruncated;
  // Sigma of one coordinate, px. Nothing: estimated from the residuals.
  std::optional<double> pixel_noise_px;
  // Treats the robot poses as exact, as observations with the given noise, or as observations with a noise that is
  // estimated together with the pixel noise (by restricted maximum likelihood).
  enum class Robot { kExact, kGivenNoise, kEstimatedNoise };
  Robot robot = Robot::kExact;
  RobotNoise robot_noise;  // Used with kGivenNoise.
  // Used with kEstimatedNoise: prior of the robot noise, for captures that are too few to determine it.
  std::optional<RobotNoisePrior> robot_noise_prior;
  // Used with kEstimatedNoise: initial guess of the robot noise. The default is an inaccurate robot.
  RobotNoise robot_noise_start = {1e-3, 2e-3, 1e-3};
  // The systematic errors of the robot that are estimated (View::effect); null: none. The standard deviations of their
  // groups are estimated too with kEstimatedNoise, and given otherwise.
  std::shared_ptr<const SharedEffects> effects;
  // Whether these standard deviations, and those of each capture's noise beside them, are kept away from zero, which
  // few effects and captures cannot prove (solvers/uncertainty/variance_components.h, VarianceGroup::avoids_zero).
  // Models are compared without that.
  bool effects_avoid_zero = true;
  // Is treated as an additional measurement of the free camera parameters.
  std::optional<CameraPrior> camera_prior;
  // One sigma of the target's scales about 1 (TargetShape), as additional measurements; nothing: they are not known.
  // The scale of the target and the size of an arm have nearly the same effect on the images.
  std::optional<double> target_scale_sigma;
  double known_target_scale_sigma = kTargetScaleSigma;  // ProblemTarget::known_scale_sigma.
  std::shared_ptr<const JointPrior> prior;              // Problem::prior.
  int max_iterations = 200;
  int num_threads = 1;  // The result does not depend on it.

  // Returns every violated constraint, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// The options of the adjustment of a problem with several cameras, targets and arms, which says itself what is free.
struct AdjustmentOptions {
  LossKind loss = LossKind::kTruncated;
  // Sigma of one coordinate of every camera, px. Nothing: estimated from the residuals, for each camera.
  std::optional<double> pixel_noise_px;
  // This holds for all arms and means what BundleOptions::robot means. The noise of each arm is estimated by itself.
  BundleOptions::Robot robot = BundleOptions::Robot::kEstimatedNoise;
  RobotNoise robot_noise;                             // Used with kGivenNoise, for all arms.
  std::optional<RobotNoisePrior> robot_noise_prior;   // See BundleOptions.
  RobotNoise robot_noise_start = {1e-3, 2e-3, 1e-3};  // Used with kEstimatedNoise.
  bool effects_avoid_zero = true;                     // See BundleOptions.
  int max_iterations = 200;
  int num_threads = 1;  // The result does not depend on it.

  // Returns every violated constraint, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

}  // namespace heba
