// The Ceres cost function of all captures of an adjustment and of what is known of its parameter blocks: one residual
// block with one row per unknown and two more, independent of the number of captures and points.
//
// The normal equations of each view (solvers/residuals/view_reduction.h) have columns for the six parameters of
// camera_from_target, the camera and the target's shape. Every other unknown adds columns that are a product with these
// six. They are chained to the unknowns that the captures share, and summed. The rows of views with few points are
// chained individually, and multiplied for many views at once. A square root of the sum has the same cost, gradient and
// Gauss-Newton matrix as all rows of all captures.
//
// The poses of a capture's own (NuisancePose) are eliminated from the normal equations of all its views (Schur
// complement), so that cost and memory grow linearly with the number of captures, and Ceres does not see them. When
// Ceres evaluates other values of the shared unknowns, the eliminated poses follow according to their linearisation.
// Equations (6) to (9) of docs/estimation.md.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <ceres/cost_function.h>

#include "solvers/refine/chained_sum.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/residuals/loss.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/block_prior.h"

namespace heba {

// The normal equations of all captures at one value of the unknowns.
struct NormalEquations {
  std::vector<double> parameters;  // The parameter blocks of CapturesCost, joined.
  // J^T J of the unknowns (LoopProblem::layout) and the residual, with the poses of the captures eliminated and with
  // the priors of the cost.
  Eigen::MatrixXd matrix;
  double loss_remainder = 0;  // See ViewNormalEquations, solvers/residuals/view_reduction.h.
};

struct CapturesCostOptions {
  double pixel_sigma_px = 1;
  const Loss* loss = nullptr;
  // True if the eliminated poses have not been estimated before. In either case they are refined at the first value of
  // the shared unknowns.
  bool eliminated_poses_are_rough = false;
  int num_threads = 1;  // Upper bound; the result does not depend on it.
  // The priors say what is known of parameter blocks; a target whose shape is known has no block.
  std::vector<BlockPrior> priors;
};

// Parameter blocks, in the order of LoopProblem::layout: one for each shared pose (heba/geometry/pose_block.h), the
// effects of each owner, all parameters of each camera, and all shape parameters of each target of which one is free.
// Evaluation fails, and Ceres rejects the step, if a point cannot be projected. With eliminated poses, only for use
// with ceres::Solve: their values depend on the point at which the Jacobians were evaluated last.
class CapturesCost final : public ceres::CostFunction {
 public:
  // The observations and the loss must outlive the cost; there must be at least one capture, and every capture must
  // have a view and at most four nuisance poses.
  CapturesCost(LoopProblem problem, CapturesCostOptions options);
  ~CapturesCost() override;
  CapturesCost(const CapturesCost&) = delete;
  CapturesCost& operator=(const CapturesCost&) = delete;

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override;

  // Returns nothing if a point cannot be projected.
  std::optional<NormalEquations> NormalEquationsAt(const double* const* parameters) const;

  // Returns the normal equations at the point where the Jacobians were evaluated last: after ceres::Solve, the
  // solution. The Jacobians must have been evaluated before.
  const NormalEquations& Accepted() const;
  // Returns the decrease of the cost that the next Gauss-Newton step from there would give according to the
  // linearisation, relative to the cost.
  double PredictedDrop() const;

  // Returns each capture's eliminated poses, optimal for the shared unknowns at which the Jacobians were evaluated
  // last: after ceres::Solve, the solution. Empty if the captures have none.
  std::vector<std::vector<Rigid3d>> EliminatedPoses() const;

 private:
  struct ViewTerms;
  struct CaptureTerms;
  struct ViewKind;
  struct EliminatedState;
  struct State;

  const ViewKind& KindOf(const LoopView& view) const;
  // Evaluates all captures. Returns false if a point cannot be projected.
  bool EvaluateAll(std::vector<double> parameters, State* state) const;
  // Sums the normal equations of captures [first, last), each at its eliminated poses. `step` is that of the shared
  // unknowns since the poses were linearised; empty if they have not been.
  bool EvaluateGroup(size_t first, size_t last, const LoopValues& at, const Eigen::VectorXd& step, State* state,
                     NormalEquations* sum) const;
  // Returns a capture's eliminated poses as predicted by their linearisation, or their initial guesses before the first
  // linearisation.
  std::vector<Rigid3d> EliminatedPosesAfter(const Eigen::VectorXd& step, size_t capture) const;
  // Evaluates a capture at these poses. Without `has_all_columns`, for its nuisance poses only.
  bool EvaluateCapture(const LoopCapture& capture, const LoopValues& at, std::vector<Rigid3d> nuisance_poses,
                       bool has_all_columns, CaptureTerms* terms) const;
  // Likewise, and refines the poses with all other unknowns held.
  bool SolveEliminatedPoses(const LoopCapture& capture, const LoopValues& at, std::vector<Rigid3d> nuisance_poses,
                            CaptureTerms* terms) const;
  // Adds the priors, at these parameters, to the lower triangle of NormalEquations::matrix.
  void AddPriors(const std::vector<double>& parameters, Eigen::MatrixXd* matrix) const;
  // Returns the tangent from one value of the parameter blocks to another, in the order of the layout.
  Eigen::VectorXd Step(const std::vector<double>& from, const std::vector<double>& to) const;
  std::vector<double> Joined(const double* const* parameters) const;

  LoopProblem problem_;
  CapturesCostOptions options_;
  std::vector<OwnerBlock> blocks_;
  std::vector<UnknownBlock> pose_blocks_;
  std::vector<UnknownBlock> effect_blocks_;
  // One for each pair of camera and target.
  std::vector<ViewKind> kinds_;
  Eigen::Index num_columns_;  // Number of unknowns, and one for the residual.
  bool has_eliminated_poses_ = false;
  // The states where the Jacobians and the cost were evaluated last: Ceres usually asks for the Jacobians at the
  // latter next.
  mutable std::shared_ptr<const State> accepted_;
  mutable std::shared_ptr<const State> candidate_;
  mutable double predicted_drop_ = 0;
};

}  // namespace heba
