// The Ceres cost of all captures together: one residual block with a row for each unknown and one more, whatever the
// number of captures and points.
//
// Each capture's products (solvers/residuals/view_reduction.h) are chained to the unknowns that the captures share, and
// summed (of views of few points the rows are chained, and multiplied many views' at once); a root of the sum has the
// same cost, gradient and Gauss-Newton matrix as all rows of all captures. A capture may have a pose of its own (a
// robot's correction, or where the target is): it is eliminated from the products before they are summed (Schur
// complement), so that cost and memory grow with the captures, not with their cube, and Ceres does not see it. Where
// the shared unknowns are tried elsewhere, it goes along as its linearisation says.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <ceres/cost_function.h>

#include "heba/camera/camera_model.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/refine/kinematic_loop.h"
#include "solvers/residuals/loss.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {

struct CaptureView {
  const Observations* observations = nullptr;
  // Its last pose block is the capture's own if there is one (CapturesCostOptions::has_eliminated_pose).
  std::unique_ptr<KinematicLoop> chain;
};

struct CaptureTerm {
  // At least one; more only with an own pose, which they then share. Residuals are each view's; the derivatives of
  // camera_from_target are the first view's for all, so the views' poses must be the same but for a robot's
  // repeatability.
  std::vector<CaptureView> views;
  Rigid3d eliminated_pose;  // Where it starts.

  CaptureTerm(const Observations* observations, std::unique_ptr<KinematicLoop> chain, const Rigid3d& start = Rigid3d());
};

// What the captures say at some value of the unknowns.
struct NormalEquations {
  std::vector<double> parameters;  // The shared poses' blocks, the camera's parameters, the shape's.
  // J^T J of the shared poses' tangents, the free parameters and the residual, own poses eliminated.
  Eigen::MatrixXd matrix;
  double loss_remainder = 0;  // As ViewNormalEquations', solvers/residuals/view_reduction.h.
};

struct CapturesCostOptions {
  double pixel_sigma_px = 1;
  const Loss* loss = nullptr;
  FreeParameters free;               // The others' Jacobians are 0.
  std::optional<TargetShape> shape;  // If `free` speaks of it; its own parameters are not used.
  bool has_eliminated_pose = false;
  std::optional<RobotNoise> eliminated_pose_prior;  // That it is the identity, give or take this.
  // What is known already, with the same captures, loss, sigma and free parameters. Captures without own poses only.
  std::optional<NormalEquations> known;
  // Own poses start where nobody has looked for them yet. Either way they are brought near their best for the first
  // value of the shared unknowns.
  bool eliminated_poses_are_rough = false;
  int num_threads = 1;  // At most; the result does not depend on it.
};

// Parameter blocks: the shared poses of the chains (heba/geometry/pose_block.h), then the camera's parameters, which
// those of the target's shape follow if there is a shape. Evaluation fails, and Ceres rejects the step, if a point has
// no image. With own poses for ceres::Solve only: what they are depends on where the Jacobians were evaluated last.
class CapturesCost final : public ceres::CostFunction {
 public:
  // `model`, the observations and the loss must outlive the cost; at least one capture.
  CapturesCost(const CameraModel& model, std::vector<CaptureTerm> captures, CapturesCostOptions options);
  ~CapturesCost() override;
  CapturesCost(const CapturesCost&) = delete;
  CapturesCost& operator=(const CapturesCost&) = delete;

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override;

  // Nothing if a point has no image.
  std::optional<NormalEquations> NormalEquationsAt(const double* const* parameters) const;

  // Where the Jacobians were evaluated last: after ceres::Solve, at the solution. They must have been.
  const NormalEquations& Accepted() const;
  // What Gauss-Newton's next step from there would make the cost less by, as its own linearisation has it; of the cost.
  double PredictedDrop() const;

  // The captures' own poses, best for the shared unknowns at which the Jacobians were evaluated last: after
  // ceres::Solve, the solution's.
  std::vector<Rigid3d> EliminatedPoses() const;

 private:
  struct EliminatedPoseState;
  struct SharedStep;
  struct State;
  // What is solved for of a capture: its products, of a left perturbation of camera_from_target, the free parameters
  // and the residual.
  struct Evaluation;

  bool EvaluateAll(std::vector<double> parameters, State* state) const;
  // What captures [first, last) add, each at its own pose.
  bool EvaluateGroup(size_t first, size_t last, const SharedStep& step, State* state, NormalEquations* sum) const;
  // Where a capture's own pose goes along to, as its linearisation says; where it starts before there is one.
  Rigid3d EliminatedPoseAfter(const SharedStep& step, size_t capture) const;
  // At Evaluation::eliminated_pose; settling begins there.
  bool EvaluateCapture(const ViewReducer& reducer, const CaptureTerm& capture, const std::vector<double>& parameters,
                       Evaluation* evaluation) const;
  bool WriteCapture(const CaptureTerm& capture, const std::vector<double>& parameters,
                    std::vector<Matrix6>* left_from_tangent, ViewRows* rows) const;
  Rigid3d CameraFromTargetOf(const CaptureView& view, const std::vector<double>& parameters,
                             const Rigid3d& eliminated_pose, std::vector<Matrix6>* left_from_tangent) const;
  std::optional<TargetShape> ShapeAt(const std::vector<double>& parameters) const;
  const double* ParamsAt(const std::vector<double>& parameters) const;
  bool SolveEliminatedPose(const CaptureTerm& capture, const std::vector<double>& parameters,
                           Evaluation* evaluation) const;
  std::vector<double> Joined(const double* const* parameters) const;

  const CameraModel& model_;
  std::vector<CaptureTerm> captures_;
  CapturesCostOptions options_;
  ViewReducer reducer_;
  ViewReducer pose_reducer_;  // Of the captures' poses alone.
  int num_shared_poses_;
  int num_params_;         // The camera's, and the shape's if it is unknown.
  std::vector<int> free_;  // Which of them.
  // Where the Jacobians were evaluated last, and where the cost was: mostly Ceres asks for the Jacobians there next.
  mutable std::shared_ptr<const State> accepted_;
  mutable std::shared_ptr<const State> candidate_;
  mutable double predicted_drop_ = 0;
};

}  // namespace heba
