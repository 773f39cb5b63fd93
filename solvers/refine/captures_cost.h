// The Ceres cost function of all captures: one residual block with one row per unknown and two more, independent of
// the number of captures and points.
//
// The normal equations of each capture (solvers/residuals/view_reduction.h) are chained to the unknowns that the
// captures share, and summed. The rows of views with few points are chained individually, and multiplied for many
// views at once. A square root of the sum has the same cost, gradient and Gauss-Newton matrix as all rows of all
// captures.
//
// A capture may have a pose of its own (the robot's correction, or the pose of the target). This pose is eliminated
// from the normal equations before they are summed (Schur complement), so that cost and memory grow linearly with the
// number of captures, and Ceres does not see it. When Ceres evaluates other values of the shared unknowns, the
// eliminated pose follows according to its linearisation. Equations (6) to (9) of docs/estimation.md.
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

// One image of a capture.
struct CaptureView {
  const Observations* observations = nullptr;
  // Its last pose block is the capture's eliminated pose, if there is one (CapturesCostOptions::has_eliminated_pose).
  std::unique_ptr<KinematicLoop> loop;
};

// One capture: a robot pose and the images taken there.
struct CaptureTerm {
  // One view or more; several views require an eliminated pose, which they share. Each view has its own residuals, but
  // the derivatives of camera_from_target are those of the first view for all of them, so their robot poses must agree
  // within the robot's repeatability.
  std::vector<CaptureView> views;
  Rigid3d eliminated_pose;  // Initial guess.

  CaptureTerm(const Observations* observations, std::unique_ptr<KinematicLoop> loop, const Rigid3d& start = Rigid3d());
};

// The normal equations of all captures at one value of the unknowns.
struct NormalEquations {
  std::vector<double> parameters;  // Blocks of the shared poses, camera parameters, shape parameters.
  // J^T J of the shared poses' tangents, the free parameters and the residual, with one pose per capture eliminated.
  Eigen::MatrixXd matrix;
  double loss_remainder = 0;  // See ViewNormalEquations, solvers/residuals/view_reduction.h.
};

struct CapturesCostOptions {
  double pixel_sigma_px = 1;
  const Loss* loss = nullptr;
  FreeParameters free;               // The Jacobians of the other parameters are 0.
  std::optional<TargetShape> shape;  // Set if `free` has entries for it; its params are not used.
  bool has_eliminated_pose = false;
  std::optional<RobotNoise> eliminated_pose_prior;  // The identity, with this noise.
  // Cached normal equations of the same captures, loss, sigma and free parameters. Only without eliminated poses.
  std::optional<NormalEquations> known;
  // True if the eliminated poses have not been estimated before. In either case they are refined at the first value of
  // the shared unknowns.
  bool eliminated_poses_are_rough = false;
  int num_threads = 1;  // Upper bound; the result does not depend on it.
};

// Parameter blocks: the shared poses of the loops (heba/geometry/pose_block.h), then the camera parameters, followed
// by those of the target's shape if there is a shape. Evaluation fails, and Ceres rejects the step, if a point cannot
// be projected. With eliminated poses, only for use with ceres::Solve: their values depend on the point at
// which the Jacobians were evaluated last.
class CapturesCost final : public ceres::CostFunction {
 public:
  // `model`, the observations and the loss must outlive the cost; there must be at least one capture.
  CapturesCost(const CameraModel& model, std::vector<CaptureTerm> captures, CapturesCostOptions options);
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

  // Returns the captures' eliminated poses, optimal for the shared unknowns at which the Jacobians were evaluated last:
  // after ceres::Solve, the solution. Empty if there are none.
  std::vector<Rigid3d> EliminatedPoses() const;

 private:
  struct EliminatedPoseState;
  struct SharedStep;
  struct State;
  // The normal equations of one capture: left perturbation of camera_from_target, free parameters and residual.
  struct Evaluation;

  // Evaluates all captures. Returns false if a point cannot be projected.
  bool EvaluateAll(std::vector<double> parameters, State* state) const;
  // Sums the normal equations of captures [first, last), each at its eliminated pose.
  bool EvaluateGroup(size_t first, size_t last, const SharedStep& step, State* state, NormalEquations* sum) const;
  // Returns a capture's eliminated pose as predicted by its linearisation, or its initial guess before the first
  // linearisation.
  Rigid3d EliminatedPoseAfter(const SharedStep& step, size_t capture) const;
  // Evaluates a capture at Evaluation::eliminated_pose, which is also where SolveEliminatedPose starts.
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
  ViewReducer pose_reducer_;  // Has columns for the pose only.
  int num_shared_poses_;
  int num_params_;         // Number of camera parameters, plus those of the shape if unknown.
  std::vector<int> free_;  // Indices of the free ones.
  // The states where the Jacobians and the cost were evaluated last: Ceres usually asks for the Jacobians at the
  // latter next.
  mutable std::shared_ptr<const State> accepted_;
  mutable std::shared_ptr<const State> candidate_;
  mutable double predicted_drop_ = 0;
};

}  // namespace heba
