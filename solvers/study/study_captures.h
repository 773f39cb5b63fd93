// The simulated captures of a study's trials.
#pragma once

#include <vector>

#include "heba/base/rng.h"
#include "heba/data/pair_problem.h"
#include "solvers/study/study_cell.h"

namespace heba {

// Returns the captures of one trial of a hand-eye calibration, whose robot has the systematic errors `drawn`, those at
// each pose in a row.
std::vector<View> SimulateViews(const StudyCell& cell, const Eigen::VectorXd& drawn, Rng& rng);

// Returns the problem of any other cell with the captures of one trial.
Problem SimulateProblem(const StudyCell& cell, Rng& rng);

// Returns the problem of a cell whose captures have no errors. Its unknowns are the poses, the free intrinsics, the
// systematic errors of the robot that are drawn, and the parts of the targets' shapes that differ from the design; the
// shapes are the true ones.
Problem ExactProblem(const StudyCell& cell);

// Returns the parts of the targets' shapes that differ from the design.
std::vector<TargetShapeGroup> ShapeGroupsOf(const StudyCell& cell);

}  // namespace heba
