// Errors of arms that may be part of the model of a calibration, and what was found of them.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/adjustment_options.h"
#include "heba/base/error.h"
#include "heba/data/shared_effects.h"

namespace heba {

class SmoothErrors;  // heba/data/smooth_errors.h.

// The sources of error that are modelled besides the pixel noise.
struct ErrorModel {
  BundleOptions::Robot robot = BundleOptions::Robot::kExact;
  std::vector<TargetShapeGroup> shape;  // Ordered as TargetShapeGroup.
  // The systematic errors of the robot; null if none are modelled.
  std::shared_ptr<const SharedEffects> effects = {};
};

// Returns the name of a model, such as "exact robot, target as designed" or "robot noise and joint offsets, target
// scaled and bent".
std::string NameOf(const ErrorModel& model);

// One of the error models that were compared (solvers/calibration/model_choice.h).
struct ModelAlternative {
  ErrorModel model;
  // LogLikelihoodOf at the model's own optimum, up to a constant common to all alternatives.
  double log_likelihood = 0;
  std::optional<RobotNoise> robot_noise = {};  // The noise that remains, if the model has any.
  int dof = 0;  // Number of variances, those of the robot's systematic errors included, and shape parameters.
  // The probability, if this model is right, of a likelihood ratio at least as large against the largest model that
  // contains it. Not set for the largest model.
  std::optional<double> p;
  // How many times as likely the model is as that largest one is if the groups of the robot's errors that this one
  // lacks have at least the standard deviations that robots have (EffectGroup::least_sigma). Set if it lacks such
  // groups, but not all, and if p does not reject it already.
  std::optional<double> odds = {};
};

// Whether errors of the robot's poses that vary smoothly with the pose are estimated, for a robot whose arm is not
// known or whose kinematics are not estimated: never, if the captures require them, or always.
enum class SmoothPoseErrors { kNone, kAuto, kAlways };

// The errors of an arm's kinematics that may be estimated.
struct ArmErrorModels {
  // The candidate models, each containing those before it; none if the arm is not known.
  std::vector<std::shared_ptr<const SharedEffects>> models;
  bool is_chosen = true;  // Whether the captures decide among them; otherwise the last is estimated.
  // Possible effects of the arm's errors on its poses, such as those of its configurations, of which the captures
  // determine the right ones. Each has one entry per capture, a function of all effects (SharedEffects::num_all), which
  // is null if the arm cannot reach the pose of the capture in this configuration.
  std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects_of_captures;
  // Likewise View::gripper_by_joints, if the noise of the joints is part of the arm's noise; otherwise empty. It is
  // part of the model together with the errors or, without models, alone.
  std::vector<std::vector<Matrix6X>> joints_of_captures = {};
  // The positions of the joints in each of them, rad or m; empty lists where they are not known. Arms move little
  // between captures that follow one another.
  std::vector<std::vector<Eigen::VectorXd>> positions_of_captures = {};
  // The errors by which the right effects are found; null: those of the last model.
  std::shared_ptr<const SharedEffects> of_branches = nullptr;
};

// Returns a noise of poses with that of the joints, as one sigma of each coordinate: root mean square over the
// captures, of which `gripper_by_joints` are the derivatives (ArmPosture); captures without known joints have an empty
// one.
RobotNoise WithJointNoise(const RobotNoise& noise, const std::vector<Matrix6X>& gripper_by_joints);

// Errors of an arm's poses that vary smoothly with the pose and that are part of the solution.
struct AddedSmoothErrors {
  size_t robot = 0;
  std::shared_ptr<const SmoothErrors> errors;
  RobotNoise noise_before;     // The noise of the arm without them.
  double p_value_without = 0;  // The probability of so likely smooth errors if the arm has none (an upper bound).
  // The log-likelihood ratio (restricted) to the model without them, and how many times as likely that is as one with
  // smooth errors that are at least as large as robots have them.
  double log_likelihood_gain = 0;
  double odds_without = 1;
};

// The outcome of the choice among the models of an arm's errors.
struct ArmErrorChoice {
  size_t robot = 0;
  std::vector<size_t> branches = {};           // One per capture: index in ArmErrorModels::effects_of_captures.
  std::shared_ptr<const SharedEffects> model;  // The errors that are part of the solution; null if none are.
  Failure reason;                              // The reason why none are.
  std::optional<RobotNoise> noise_before;      // The noise of the arm without them, if it has any.
  std::vector<ModelAlternative> alternatives;  // The models that were compared, the simplest first.
};

}  // namespace heba
