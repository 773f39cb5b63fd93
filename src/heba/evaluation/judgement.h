// Grades findings and orders them, for the verdicts on a single camera and on a rig.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/data/pair_solution.h"
#include "heba/evaluation/finding.h"

namespace heba {

// Returns the error of one capture that a robot's noise and its smooth errors explain, as a share of the distance.
double RobotErrorShare(const std::optional<RobotNoise>& noise, const std::optional<RobotNoise>& smooth_noise,
                       double distance_m);
// Returns the grade of a sigma, as a share of the distance. `robot_error_share` is RobotErrorShare of `num_captures`
// captures: a sigma that they could not make much smaller is not bad.
Grade GradeOfSigma(double share_of_distance, double robot_error_share, int num_captures);
// Returns the grade of the errors of targets on captures that the estimate has not seen. Errors that those of the robot
// explain (RobotErrorShare) are not bad.
Grade GradeOfHeldOut(double share_of_distance, double deg, double robot_error_share);
// Returns the grade of errors that the noise does not explain. They make a result bad only if they matter at the
// target.
Grade GradeOfMisfit(double chi2_per_dof, Grade of_hold_out);

// A capture and the change of a camera's pose without it.
struct NamedMove {
  std::string capture;
  CaptureMove move;
};
// Returns the finding `influential_capture` if a capture has more influence than chance explains, where the probability
// is multiplied by the number of captures that were tested, and if its move matters at the distance of the target. If
// many captures are improbable, the assumed noise is wrong rather than the captures.
std::optional<Finding> JudgeMoves(const std::vector<NamedMove>& moves, double distance_m);

// Returns whether a finding is what errors of the model show as. It contains the others as parts, if it says most.
bool IsMisfit(const Finding& finding);

// Returns findings whose symptoms that are no worse than a cause are parts of it: its consequences. Without such a
// cause, the symptoms are parts of the one that says most: one fault is one finding.
std::vector<Finding> WithSymptomsGathered(std::vector<Finding> findings);

// Returns sorted findings: the worst first; among equal grades, causes first.
std::vector<Finding> Sorted(std::vector<Finding> findings);

}  // namespace heba
