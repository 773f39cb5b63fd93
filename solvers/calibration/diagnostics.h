// Findings about a calibration, each with a code, numbers and names.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/free_parameters.h"
#include "heba/data/pair_solution.h"
#include "heba/evaluation/finding.h"
#include "heba/pair_calibration_types.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// Returns the finding `model`: the error model that was chosen, and the alternative that it was preferred to, with
// figures.
Finding DescribeModel(const ErrorModel& chosen, const std::vector<ModelAlternative>& alternatives,
                      const PairSolution& solution);

// Returns findings about the parts of the model that the options hold, from ChooseModel at the solution with all parts
// free to be chosen: `robot_noise_ignored` if the robot was taken as exact, but its errors exceed what the pixel noise
// explains; `target_shape_ignored` if the target was taken as designed, but is scaled or bent by enough to matter. If
// there are any, the advice has the change to the solution of the model that was chosen.
Advice DiagnoseModel(const PairProblem& problem, const PairSolution& solution, const BundleOptions& options,
                     const AutoModel& chosen);

// Returns the finding `target_scale` if the scale of a target, which is free, differs from its design by more than
// printing explains, or by more than four sigmas of what is known about it: `known_sigma` is one sigma of its ratio to
// the scale of the robot. The grade is bad beyond 2 %: the dimensions in the config or the units of the robot's poses
// are then wrong.
std::optional<Finding> JudgeScale(const TargetShape& shape, const Covariance& covariance, std::string_view block,
                                  bool is_focal_held, double known_sigma);

// Returns the finding `held_intrinsics` if the held intrinsics contradict the images and the robot's poses, by a joint
// F-test of the changes in a refinement that frees them, and the change of the estimate. It names the part of the
// intrinsics that alone explains the contradiction, if one does. The advice is empty if they agree, or if they cannot
// be freed.
Advice DiagnoseHeldIntrinsics(const PairProblem& problem, const PairSolution& solution, const BundleOptions& options,
                              const AutoModel& choose);
// The poses of a camera and of a target, with held and with free intrinsics of the camera.
struct FreedPoses {
  Rigid3d mount_from_held;
  Rigid3d mount_from_freed;
  double target_move_m = 0;  // Distance between the target's positions.
  double distance_m = 1;     // Between camera and target.
};
// Returns that finding for a camera of which all intrinsics were freed. `covariance` has their `block`. It is bad only
// if the target moves as well: another focal length moves the camera and what it sees by the same amount.
std::optional<Finding> JudgeHeldIntrinsics(const Camera& held, const Camera& freed, const Covariance& covariance,
                                           std::string_view block, double covariance_dof, const FreedPoses& poses);

// Returns the finding `camera`: how a given camera was used (held, as initial guess, as prior), and by how many sigmas
// the refinement changed it.
Finding DescribeCameraUse(const Camera& given, const PairSolution& solution, const BundleOptions& options);

}  // namespace heba
