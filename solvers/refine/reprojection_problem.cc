#include "solvers/refine/reprojection_problem.h"

#include <optional>
#include <sstream>

#include <ceres/manifold.h>

#include "heba/base/error.h"
#include "heba/geometry/pose_block.h"
#include "solvers/refine/joint_prior_cost.h"

namespace heba {

ceres::Solver::Options ReprojectionSolverOptions(int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = max_iterations;
  // The error that remains within these tolerances is far below the last step, which is itself far below the noise.
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-13;
  options.gradient_tolerance = 1e-14;
  // Initial guesses are good, so the first steps should be undamped Gauss-Newton steps. A poor guess costs some
  // rejected steps.
  options.initial_trust_region_radius = 1e6;
  // Steps that put a point behind the camera are rejected one by one until the trust region is small enough.
  options.max_num_consecutive_invalid_steps = 50;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

LoopUnknowns::LoopUnknowns(const UnknownLayout& layout, const LoopValues& values)
    : layout_(layout), held_(values.targets), places_(ParameterBlocksOf(layout)), all_(JoinedBlocks(places_, values)) {
  for (const OwnerBlock& place : places_) blocks_.push_back(&all_[place.first]);
}

void LoopUnknowns::AddTo(ceres::Problem* ceres_problem) {
  for (size_t b = 0; b < places_.size(); ++b) {
    const UnknownBlock& unknowns = places_[b].unknowns;
    if (unknowns.owner == UnknownOwner::kPose) {
      ceres_problem->AddParameterBlock(blocks_[b], places_[b].size, new PoseManifold);
      continue;
    }
    ceres_problem->AddParameterBlock(blocks_[b], places_[b].size);
    std::vector<bool> is_free(static_cast<size_t>(places_[b].size), false);
    for (Eigen::Index i = unknowns.first; i < unknowns.end(); ++i) {
      is_free[static_cast<size_t>(layout_[i].index)] = true;
    }
    std::vector<int> held;
    for (int i = 0; i < places_[b].size; ++i) {
      if (!is_free[static_cast<size_t>(i)]) held.push_back(i);
    }
    if (unknowns.size == 0) {
      ceres_problem->SetParameterBlockConstant(blocks_[b]);
    } else if (!held.empty()) {
      ceres_problem->SetManifold(blocks_[b], new ceres::SubsetManifold(places_[b].size, held));
    }
  }
}

namespace {

// Stops the iteration if the predicted relative decrease of the cost is at most `tolerance`.
class StopAtMinimum final : public ceres::IterationCallback {
 public:
  StopAtMinimum(const CapturesCost& cost, double tolerance) : cost_(cost), tolerance_(tolerance) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*iteration*/) override {
    return cost_.PredictedDrop() <= tolerance_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const CapturesCost& cost_;
  double tolerance_;
};

}  // namespace

ceres::Solver::Summary SolveCaptures(ceres::Solver::Options options, CapturesCost* cost, LoopUnknowns* unknowns,
                                     const JointPrior* joint) {
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  unknowns->AddTo(&problem);
  problem.AddResidualBlock(cost, nullptr, unknowns->blocks());
  std::optional<JointPriorCost> joint_cost;
  if (joint != nullptr) {
    joint_cost.emplace(*joint, unknowns->layout(), unknowns->held());
    problem.AddResidualBlock(&*joint_cost, nullptr, unknowns->blocks());
  }
  ceres::Solver::Summary summary;
  if (joint != nullptr) {
    ceres::Solve(options, &problem, &summary);
    return summary;
  }
  StopAtMinimum stop(*cost, options.function_tolerance);
  options.callbacks.push_back(&stop);
  ceres::Solve(options, &problem, &summary);
  if (summary.termination_type == ceres::USER_SUCCESS) {
    summary.termination_type = ceres::CONVERGENCE;
    std::ostringstream message;
    message << "Function tolerance reached. The next step's |cost_change|/cost: " << cost->PredictedDrop()
            << " <= " << options.function_tolerance;
    summary.message = message.str();
  }
  return summary;
}

}  // namespace heba
