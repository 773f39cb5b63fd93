// A joint prior is the result of an earlier session as an observation of all unknowns of a problem together.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

struct JointPrior {
  // The means, by the name of the block of unknowns: the poses, and all parameters of the cameras and of the targets'
  // shapes, known or not.
  std::map<std::string, Rigid3d> poses;
  std::map<std::string, std::vector<double>> params;
  // The covariance of the means. Parameters that it lacks were held: it says nothing about them.
  Covariance covariance;
  // The changes of the means, in the layout of the covariance, by the causes that all sessions of the cell have in
  // common (Solution::covariance_repeatable): a new session does not average them.
  std::vector<Eigen::VectorXd> of_cell;
};

// A cell may have changed since the earlier session.
struct ChangeOfCell {
  // One sigma of the motion of each camera on its mount, along and about each axis of the camera.
  double translation_m = 0;
  double rotation_rad = 0;
  bool is_target_moved = false;  // The targets stand elsewhere, or are held otherwise.
};

// Returns the solution of the earlier session as prior of `problem`: of the cameras, targets and bases that have the
// same names in both. A single camera, a single target and a single arm are the same whatever their names are. Errors
// of arms are not part of it: what they contribute to the uncertainty of the others is.
JointPrior JointPriorOf(const Problem& earlier, const Solution& solution, const Problem& problem,
                        const ChangeOfCell& change);

}  // namespace heba
