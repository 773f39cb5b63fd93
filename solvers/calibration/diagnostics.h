// Findings about a calibration beside its figures, each with a code, numbers and an action.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// `weak_direction`: the parts of the result whose one sigma exceeds what a cell usually needs (1 mm, 0.1 deg, 0.2 % of
// the focal length, 0.2 % of the image's width for its centre), the worst first: the direction in which it is known
// worst, along the axis of a frame where it is near one, how well, and the motion that would improve the worst most,
// with what it would become. The motions are tried: two more captures of each kind (target tilted about its axes,
// rotated in its plane, nearer and farther, towards the image's sides), from the middle one of the captures, by what
// their points would add to the normal matrix. Nothing if all is well known.
std::optional<Finding> DiagnoseWeakDirections(const Problem& problem, const Solution& solution,
                                              const FreeParameters& free);

// `model`: which model of the errors was chosen, against what, with figures.
Finding DescribeModel(const ErrorModel& chosen, const std::vector<ModelAlternative>& alternatives,
                      const Solution& solution);

// Returns what the captures show beyond doubt of the parts of the model that the options hold fixed (ChooseModel at the
// solution, with all parts to be chosen): `robot_noise_ignored` if a robot that was taken as exact is not, by more than
// the pixels' noise; `target_shape_ignored` if a target that was taken as designed is stretched or bent by enough to
// matter.
std::vector<Finding> DiagnoseModel(const Problem& problem, const Solution& solution, const BundleOptions& options,
                                   const AutoModel& chosen);

// `target_scale`: the target's estimated scale differs from its design by more than a print does. Bad beyond 2 %: then
// its measures are wrong in the config, or the robot's units.
std::optional<Finding> DiagnoseScale(const Solution& solution, const ErrorModel& model);

// `held_intrinsics`: intrinsics that were held contradict the images and the robot's poses, by a refinement that frees
// them (F-test of all of them together). Nothing if they agree, or if they cannot be freed.
std::optional<Finding> DiagnoseHeldIntrinsics(const Problem& problem, const Solution& solution,
                                              const BundleOptions& options, const AutoModel& choose);

// `camera`: how a given camera was used (held, as start, as prior), and how far the refinement moved it, in sigmas.
Finding DescribeCameraUse(const Camera& given, const Solution& solution, const BundleOptions& options);

}  // namespace heba
