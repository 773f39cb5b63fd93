#include "solvers/refine/joint_prior_cost.h"

#include <utility>

#include "heba/geometry/pose_block.h"
#include "heba/kernels/small_matrix.h"

namespace heba {

JointPriorCost::JointPriorCost(const JointPrior& prior, UnknownLayout layout, std::vector<TargetShape> held)
    : prior_(prior), layout_(std::move(layout)), held_(std::move(held)), blocks_(ParameterBlocksOf(layout_)) {
  set_num_residuals(static_cast<int>(PlacesIn(layout_, prior).size()));
  for (const OwnerBlock& block : blocks_) mutable_parameter_block_sizes()->push_back(block.size);
}

bool JointPriorCost::Evaluate(const double* const* parameters, double* residuals, double** jacobians) const {
  std::vector<double> joined;
  for (size_t b = 0; b < blocks_.size(); ++b) {
    joined.insert(joined.end(), parameters[b], parameters[b] + blocks_[b].size);
  }
  const JointPriorRows rows = RowsOf(prior_, layout_, ValuesIn(blocks_, joined, held_));
  Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = rows.residuals;
  for (size_t b = 0; jacobians != nullptr && b < blocks_.size(); ++b) {
    if (jacobians[b] == nullptr) continue;
    Eigen::Map<RowMajorMatrix> jacobian(jacobians[b], num_residuals(), blocks_[b].size);
    jacobian.setZero();
    const UnknownBlock& unknowns = blocks_[b].unknowns;
    if (unknowns.owner == UnknownOwner::kEffects) continue;
    if (unknowns.owner == UnknownOwner::kPose) {
      jacobian = rows.by_unknowns.middleCols<6>(unknowns.first) * TangentFromBlock(parameters[b]);
      continue;
    }
    for (Eigen::Index i = unknowns.first; i < unknowns.end(); ++i) {
      jacobian.col(layout_[i].index) = rows.by_unknowns.col(i);
    }
  }
  return true;
}

}  // namespace heba
