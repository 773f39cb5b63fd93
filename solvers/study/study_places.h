// The robot of a study's cell: its errors, and the predictions of the target at the places of the cell.
#pragma once

#include <memory>

#include "heba/base/rng.h"
#include "heba/data/pair_solution.h"
#include "solvers/study/study_cell.h"

namespace heba {

// Returns the errors that are drawn in the trials: those of the groups with a standard deviation. Null if there are
// none.
std::shared_ptr<const SharedEffects> DrawnErrors(const StudyCell& cell);

// Draws the systematic errors of the robot; empty if it has none.
Eigen::VectorXd DrawErrors(const StudyCell& cell, Rng& rng);

// Returns the error of a robot pose: the systematic errors `drawn`, then a draw of the noise of the joints.
Rigid3d DrawPoseError(const PoseEffect& effect, const Matrix6X& gripper_by_joints, const Eigen::VectorXd& drawn,
                      double joint_noise_rad, Rng& rng);

// Returns an estimate with the errors of a solution's predictions at the places of the cell. The regions are those of a
// further capture there, whose joints are noisy too.
TrialEstimate WithPlaceErrors(TrialEstimate estimate, const StudyCell& cell, const PairSolution& solution,
                              const Eigen::VectorXd& drawn, Rng& rng);

// Returns a bound with those at the places of the cell, from the covariance of all unknowns, with the errors `drawn`
// among them.
StudyErrors WithPlaceBounds(StudyErrors bound, const StudyCell& cell, const SharedEffects* drawn,
                            const Covariance& covariance);

}  // namespace heba
