// Common parts of all Ceres problems over views.
#pragma once

#include <vector>

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "solvers/refine/captures_cost.h"
#include "solvers/residuals/loop_problem.h"

namespace heba {

struct JointPrior;  // heba/data/joint_prior.h

// Returns settings for small dense problems that are solved to full precision. One thread is used, so that the result
// does not depend on the number of threads.
ceres::Solver::Options ReprojectionSolverOptions(int max_iterations);

// The shared unknowns of a problem in one array, in the order of the parameter blocks of CapturesCost. Ceres orders
// blocks by their addresses; contiguous storage fixes the order of summation, so the result is identical to the last
// digit in every thread.
class LoopUnknowns {
 public:
  LoopUnknowns(const UnknownLayout& layout, const LoopValues& values);

  // Adds the blocks to a Ceres problem and holds what is not free. This object must outlive the Ceres problem.
  void AddTo(ceres::Problem* ceres_problem);
  const std::vector<double*>& blocks() const { return blocks_; }
  const std::vector<double>& all() const { return all_; }
  const UnknownLayout& layout() const { return layout_; }
  const std::vector<TargetShape>& held() const { return held_; }  // All shapes, as they were given.
  // Returns the values, with unit quaternions.
  LoopValues Values() const { return ValuesIn(places_, all_, held_); }

 private:
  UnknownLayout layout_;
  std::vector<TargetShape> held_;
  std::vector<OwnerBlock> places_;
  std::vector<double> all_;
  std::vector<double*> blocks_;
};

// Calls ceres::Solve for a problem of `cost` and, if it is not null, a prior of all unknowns, from the values of the
// unknowns, which become those of the solution. Without that prior, convergence is also reached if the predicted
// relative decrease of the cost in the next step is below options.function_tolerance; Ceres alone detects that only
// after the step.
ceres::Solver::Summary SolveCaptures(ceres::Solver::Options options, CapturesCost* cost, LoopUnknowns* unknowns,
                                     const JointPrior* joint = nullptr);

}  // namespace heba
