// The Ceres cost function of a joint prior: its rows, with the parameter blocks of CapturesCost.
#pragma once

#include <vector>

#include <ceres/cost_function.h>

#include "solvers/residuals/loop_problem.h"
#include "solvers/uncertainty/joint_prior_rows.h"

namespace heba {

class JointPriorCost final : public ceres::CostFunction {
 public:
  // The prior must outlive the cost. `held` has the shapes of the targets that have no parameter block.
  JointPriorCost(const JointPrior& prior, UnknownLayout layout, std::vector<TargetShape> held);

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const JointPrior& prior_;
  UnknownLayout layout_;
  std::vector<TargetShape> held_;
  std::vector<OwnerBlock> blocks_;
};

}  // namespace heba
