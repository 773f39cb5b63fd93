#include "solvers/refine/captures_cost.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/Cholesky>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/geometry/pose_block.h"
#include "heba/kernels/simd.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Captures are summed in groups that do not depend on the number of threads; neither do the digits of the result.
constexpr int kMaxGroups = 32;
constexpr int kCapturesPerGroup = 16;

constexpr int kPoseSize = 7;

using PoseRows = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// Returns whether a derivative of the chain rule is -I, as for the hand-eye pose, whose tangent is in the camera frame.
bool IsMirror(const Matrix6& chain) { return chain == -Matrix6::Identity(); }

// Rows of views with at most this many points are chained individually, which is cheaper than chaining their
// products.
constexpr int kFewPoints = 16;

// Accumulates the products of the rows of views with few points, chained to the shared poses.
class ApplyChainRule {
 public:
  ApplyChainRule(int num_shared_poses, int num_others)
      : num_shared_poses_(num_shared_poses), num_others_(num_others), stacked_(6 * num_shared_poses + num_others) {}

  // Adds the rows of a view with at most kFewPoints points.
  void Add(const ViewRows& rows, const std::vector<Matrix6>& left_from_tangent) {
    const Eigen::Index num_rows = rows.columns.rows();
    double* const columns = stacked_.NextColumns(num_rows);
    const auto from = [&](int c) { return rows.columns.data() + c * rows.columns.outerStride(); };
    const double* const by_left[] = {from(0), from(1), from(2), from(3), from(4), from(5)};
    for (int pose = 0; pose < num_shared_poses_; ++pose) {
      const Matrix6& chain = left_from_tangent[static_cast<size_t>(pose)];
      const bool is_mirror = IsMirror(chain);
      for (int c = 0; c < 6; ++c) {
        double* const to = columns + (6 * pose + c) * StackedRows::kMaxRows;
        if (is_mirror) {
          for (Eigen::Index i = 0; i < num_rows; ++i) to[i] = -by_left[c][i];
        } else {
          for (Eigen::Index i = 0; i < num_rows; i += kMaxLanes) ChainRows(by_left, chain, c, i, to + i);
        }
      }
    }
    for (int c = 0; c < num_others_; ++c) {
      std::copy_n(from(6 + c), num_rows, columns + (6 * num_shared_poses_ + c) * StackedRows::kMaxRows);
    }
  }

  // Adds the sums to the lower triangle of `matrix`.
  void AddTo(Eigen::MatrixXd* matrix) { stacked_.AddTo(matrix); }

 private:
  static_assert(PaddedToLanes(2 * kFewPoints) <= StackedRows::kMaxRows);
  // Columns for two poses, the camera, the target's shape and the residual.
  static_assert(12 + 4 + ProjectionBatch::kMaxDistortion + TargetShape::kNumParams + 1 <= StackedRows::kMaxColumns);

  // Applies the chain rule to kMaxLanes rows of one column.
  static void ChainRows(const double* const (&by_left)[6], const Matrix6& chain, int c, Eigen::Index first,
                        double* to) {
    double sums[kMaxLanes] = {};
    for (int k = 0; k < 6; ++k) {
      for (int i = 0; i < kMaxLanes; ++i) sums[i] += by_left[k][first + i] * chain(k, c);
    }
    std::copy_n(sums, kMaxLanes, to);
  }

  int num_shared_poses_;
  int num_others_;
  StackedRows stacked_;
};

// Returns own^-1 right. `own` is positive definite: if a view does not determine its pose, a prior does.
PoseRows SolveOwn(const Matrix6& own, const PoseRows& right) {
  const Eigen::LLT<Matrix6> root(own);
  if (root.info() != Eigen::Success) return own.ldlt().solve(right);
  const Matrix6 inverse_root = InverseOfLower(root.matrixLLT());
  return inverse_root.transpose().lazyProduct(PoseRows(inverse_root.lazyProduct(right)));
}

// Adds the products of a view, for a left perturbation of its pose and the other columns, to those for the tangents
// of the shared poses (chain rule). Only the lower triangle is used.
void AddChained(const Eigen::MatrixXd& products, const std::vector<Matrix6>& left_from_tangent, int num_shared_poses,
                Eigen::MatrixXd* sum) {
  const Eigen::Index num_others = products.cols() - 6;
  const Eigen::Index num_shared = 6 * num_shared_poses;
  const Matrix6 by_pose = products.topLeftCorner<6, 6>();
  const Eigen::Ref<const Eigen::MatrixXd> others_by_pose = products.block(6, 0, num_others, 6);
  for (int k = 0; k < num_shared_poses; ++k) {
    const Matrix6& chain = left_from_tangent[static_cast<size_t>(k)];
    const bool is_mirror = IsMirror(chain);
    const Matrix6 half = is_mirror ? Matrix6(-by_pose) : Matrix6(chain.transpose() * by_pose);
    for (int l = 0; l < k; ++l) {
      sum->block<6, 6>(6 * k, 6 * l).noalias() += half * left_from_tangent[static_cast<size_t>(l)];
    }
    if (is_mirror) {
      sum->block<6, 6>(6 * k, 6 * k) += by_pose;
      sum->block(num_shared, 6 * k, num_others, 6) -= others_by_pose;
      continue;
    }
    sum->block<6, 6>(6 * k, 6 * k).noalias() += half * chain;
    sum->block(num_shared, 6 * k, num_others, 6).noalias() += others_by_pose.lazyProduct(chain);
  }
  sum->bottomRightCorner(num_others, num_others) += products.bottomRightCorner(num_others, num_others);
}

}  // namespace

// A capture, evaluated at one value of its eliminated pose.
struct CapturesCost::Evaluation {
  Rigid3d eliminated_pose;
  std::vector<Matrix6> left_from_tangent;  // Shared poses, then the eliminated pose.
  ViewNormalEquations products;
  // The eliminated pose: the 6 x 6 matrix of its normal equations, and its 6 rows with all columns of the products.
  Matrix6 own;
  PoseRows with_others;
  double prior_squares = 0;

  double Cost() const {
    return products.matrix(products.matrix.rows() - 1, products.matrix.rows() - 1) + products.loss_remainder +
           prior_squares;
  }
};

// The state of a capture's eliminated pose where the cost was evaluated.
struct CapturesCost::EliminatedPoseState {
  Rigid3d pose;
  std::vector<Matrix6> left_from_tangent;
  double cost = 0;            // Cost of the capture at this pose.
  double predicted_drop = 0;  // Predicted decrease of that cost by the own step alone.
  // The best step is -step * [left perturbation by the shared poses' steps, step of the free parameters, 1].
  PoseRows step;
};

// All captures, evaluated at one value of the shared unknowns.
struct CapturesCost::State {
  NormalEquations shared;
  std::vector<EliminatedPoseState> own_poses;  // Empty if the captures have none.

  double Cost() const {
    return std::max(0.0, shared.matrix(shared.matrix.rows() - 1, shared.matrix.cols() - 1)) + shared.loss_remainder;
  }
};

// The step of the shared unknowns since the eliminated poses were linearised; empty if they have not been.
struct CapturesCost::SharedStep {
  std::vector<Tangent6> poses;
  Eigen::VectorXd params;  // Free parameters only.
};

CaptureTerm::CaptureTerm(const Observations* observations, std::unique_ptr<KinematicLoop> loop, const Rigid3d& start)
    : eliminated_pose(start) {
  views.push_back({observations, std::move(loop)});
}

CapturesCost::CapturesCost(const CameraModel& model, std::vector<CaptureTerm> captures, CapturesCostOptions options)
    : model_(model),
      captures_(std::move(captures)),
      options_(std::move(options)),
      reducer_(model, options_.free, options_.pixel_sigma_px, *options_.loss),
      pose_reducer_(model, FreeParameters(options_.free.size(), false), options_.pixel_sigma_px, *options_.loss),
      num_params_(NumParams(model) + (options_.shape ? TargetShape::kNumParams : 0)) {
  CHECK(!captures_.empty());
  for (int i = 0; i < num_params_; ++i) {
    if (options_.free[static_cast<size_t>(i)]) free_.push_back(i);
  }
  int num_points = 0;
  for (const CaptureTerm& capture : captures_) {
    CHECK(capture.views.size() == 1 || (options_.has_eliminated_pose && !capture.views.empty()));
    for (const CaptureView& view : capture.views) num_points += view.observations->size();
  }
  options_.num_threads = ThreadsFor(num_points, options_.num_threads);
  num_shared_poses_ = captures_.front().views.front().loop->num_blocks() - (options_.has_eliminated_pose ? 1 : 0);
  CHECK_LE(num_shared_poses_, 2);
  if (options_.known) {
    CHECK(!options_.has_eliminated_pose);
    CHECK_EQ(options_.known->matrix.cols(), 6 * num_shared_poses_ + static_cast<Eigen::Index>(free_.size()) + 1);
  }
  for (int i = 0; i < num_shared_poses_; ++i) mutable_parameter_block_sizes()->push_back(kPoseSize);
  mutable_parameter_block_sizes()->push_back(num_params_);
  // One more row holds the difference between the sum of rho and the weighted sum of squares.
  set_num_residuals(6 * num_shared_poses_ + static_cast<int>(free_.size()) + 2);
}

CapturesCost::~CapturesCost() = default;

bool CapturesCost::Evaluate(const double* const* parameters, double* residuals, double** jacobians) const {
  std::vector<double> at = Joined(parameters);
  if (candidate_ == nullptr || candidate_->shared.parameters != at) {
    const auto state = std::make_shared<State>();
    if (!EvaluateAll(std::move(at), state.get())) return false;
    candidate_ = state;
  }
  Eigen::Map<Eigen::VectorXd> residual(residuals, num_residuals());
  if (jacobians == nullptr) {
    // Only the cost is needed.
    residual.setZero();
    residual[0] = std::sqrt(candidate_->Cost());
    return true;
  }
  const Eigen::MatrixXd root = PivotedCholesky(candidate_->shared.matrix);
  residual.head(root.rows()) = root.rightCols<1>();
  residual[root.rows()] = std::sqrt(candidate_->shared.loss_remainder);
  for (int i = 0; i <= num_shared_poses_; ++i) {
    if (jacobians[i] == nullptr) continue;
    const bool is_pose = i < num_shared_poses_;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> jacobian(
        jacobians[i], num_residuals(), is_pose ? kPoseSize : num_params_);
    jacobian.bottomRows<1>().setZero();
    if (is_pose) {
      jacobian.topRows(root.rows()) = root.middleCols<6>(6 * i) * TangentFromBlock(parameters[i]);
    } else {
      jacobian.topRows(root.rows()).setZero();
      Eigen::Index column = 6 * num_shared_poses_;
      for (const int param : free_) jacobian.col(param).head(root.rows()) = root.col(column++);
    }
  }
  // Ceres evaluates Jacobians only where it stays.
  accepted_ = candidate_;
  predicted_drop_ = root.col(root.cols() - 1).head(root.rows() - 1).squaredNorm();
  for (const EliminatedPoseState& own : accepted_->own_poses) predicted_drop_ += own.predicted_drop;
  return true;
}

const NormalEquations& CapturesCost::Accepted() const {
  CHECK(accepted_ != nullptr);
  return accepted_->shared;
}

double CapturesCost::PredictedDrop() const {
  CHECK(accepted_ != nullptr);
  return predicted_drop_ / accepted_->Cost();
}

std::vector<double> CapturesCost::Joined(const double* const* parameters) const {
  std::vector<double> joined;
  for (int i = 0; i < num_shared_poses_; ++i) joined.insert(joined.end(), parameters[i], parameters[i] + kPoseSize);
  joined.insert(joined.end(), parameters[num_shared_poses_], parameters[num_shared_poses_] + num_params_);
  return joined;
}

std::optional<NormalEquations> CapturesCost::NormalEquationsAt(const double* const* parameters) const {
  State state;
  if (!EvaluateAll(Joined(parameters), &state)) return std::nullopt;
  return std::move(state.shared);
}

bool CapturesCost::EvaluateAll(std::vector<double> parameters, State* state) const {
  if (options_.known && options_.known->parameters == parameters) {
    state->shared = *options_.known;
    return true;
  }
  state->shared.parameters = std::move(parameters);
  const std::vector<double>& at = state->shared.parameters;
  const auto num_free = static_cast<Eigen::Index>(free_.size());
  if (options_.has_eliminated_pose) state->own_poses.resize(captures_.size());
  SharedStep step;
  if (options_.has_eliminated_pose && accepted_ != nullptr) {
    const std::vector<double>& from = accepted_->shared.parameters;
    for (int i = 0; i < num_shared_poses_; ++i) {
      step.poses.push_back(LocalCoordinates(FromBlock(&from[static_cast<size_t>(kPoseSize * i)]),
                                            FromBlock(&at[static_cast<size_t>(kPoseSize * i)])));
    }
    step.params.resize(num_free);
    for (Eigen::Index i = 0; i < num_free; ++i) {
      const auto param = static_cast<size_t>(kPoseSize * num_shared_poses_ + free_[static_cast<size_t>(i)]);
      step.params[i] = at[param] - from[param];
    }
  }

  const int num_captures = static_cast<int>(captures_.size());
  const int num_groups = std::clamp(num_captures / kCapturesPerGroup, 1, kMaxGroups);
  std::vector<NormalEquations> sums(static_cast<size_t>(num_groups));
  std::vector<char> has_failed(static_cast<size_t>(num_groups), 0);
  ParallelFor(num_groups, options_.num_threads, [&](int index) {
    const auto first_of = [&](int g) {
      return static_cast<size_t>(static_cast<int64_t>(num_captures) * g / num_groups);
    };
    const auto group = static_cast<size_t>(index);
    has_failed[group] = !EvaluateGroup(first_of(index), first_of(index + 1), step, state, &sums[group]);
  });
  if (std::find(has_failed.begin(), has_failed.end(), 1) != has_failed.end()) return false;
  for (size_t group = 1; group < sums.size(); ++group) {
    sums[0].matrix += sums[group].matrix;
    sums[0].loss_remainder += sums[group].loss_remainder;
  }
  // Only the lower triangles were summed.
  state->shared.matrix = sums[0].matrix.selfadjointView<Eigen::Lower>();
  state->shared.loss_remainder = sums[0].loss_remainder;
  return true;
}

Rigid3d CapturesCost::EliminatedPoseAfter(const SharedStep& step, size_t capture) const {
  if (accepted_ == nullptr) return captures_[capture].eliminated_pose;
  const EliminatedPoseState& before = accepted_->own_poses[capture];
  Tangent6 left = Tangent6::Zero();
  for (size_t k = 0; k < step.poses.size(); ++k) left += before.left_from_tangent[k] * step.poses[k];
  return Retract(before.pose,
                 -(before.step.leftCols<6>() * left + before.step.middleCols(6, step.params.size()) * step.params +
                   before.step.rightCols<1>()));
}

bool CapturesCost::EvaluateGroup(size_t first, size_t last, const SharedStep& step, State* state,
                                 NormalEquations* sum) const {
  const std::vector<double>& at = state->shared.parameters;
  const int num_others = static_cast<int>(free_.size()) + 1;
  const Eigen::Index num_columns = 6 * num_shared_poses_ + num_others;
  sum->matrix.setZero(num_columns, num_columns);
  const bool settles = accepted_ == nullptr;
  std::optional<ApplyChainRule> rows_of_few;
  ViewRows rows;
  Evaluation evaluation;
  for (size_t i = first; i < last; ++i) {
    if (!options_.has_eliminated_pose && captures_[i].views.front().observations->size() <= kFewPoints) {
      if (!WriteCapture(captures_[i], at, &evaluation.left_from_tangent, &rows)) return false;
      if (!rows_of_few) rows_of_few.emplace(num_shared_poses_, num_others);
      rows_of_few->Add(rows, evaluation.left_from_tangent);
      sum->loss_remainder += rows.loss_remainder;
      continue;
    }
    if (!options_.has_eliminated_pose) {
      if (!EvaluateCapture(reducer_, captures_[i], at, &evaluation)) return false;
      AddChained(evaluation.products.matrix, evaluation.left_from_tangent, num_shared_poses_, &sum->matrix);
      sum->loss_remainder += evaluation.products.loss_remainder;
      continue;
    }
    evaluation.eliminated_pose = EliminatedPoseAfter(step, i);
    bool is_evaluated = settles ? SolveEliminatedPose(captures_[i], at, &evaluation)
                                : EvaluateCapture(reducer_, captures_[i], at, &evaluation);
    if (!is_evaluated && accepted_ != nullptr) {
      // A point cannot be projected from the predicted pose: refine from the accepted pose instead.
      evaluation.eliminated_pose = accepted_->own_poses[i].pose;
      is_evaluated = SolveEliminatedPose(captures_[i], at, &evaluation);
    }
    if (!is_evaluated) return false;
    EliminatedPoseState& own = state->own_poses[i];
    own.pose = evaluation.eliminated_pose;
    own.cost = evaluation.Cost();
    own.step = SolveOwn(evaluation.own, evaluation.with_others);
    own.predicted_drop = evaluation.with_others.rightCols<1>().dot(own.step.rightCols<1>());
    Eigen::MatrixXd& products = evaluation.products.matrix;
    products(num_others + 5, num_others + 5) += evaluation.prior_squares;
    products.noalias() -= evaluation.with_others.transpose().lazyProduct(own.step);
    AddChained(products, evaluation.left_from_tangent, num_shared_poses_, &sum->matrix);
    sum->loss_remainder += evaluation.products.loss_remainder;
    own.left_from_tangent = std::move(evaluation.left_from_tangent);
  }
  if (rows_of_few) rows_of_few->AddTo(&sum->matrix);
  return true;
}

Rigid3d CapturesCost::CameraFromTargetOf(const CaptureView& view, const std::vector<double>& parameters,
                                         const Rigid3d& eliminated_pose,
                                         std::vector<Matrix6>* left_from_tangent) const {
  std::array<const double*, 4> blocks{};
  CHECK_LT(static_cast<size_t>(num_shared_poses_), blocks.size());
  const auto num_shared = static_cast<size_t>(num_shared_poses_);
  for (size_t i = 0; i < num_shared; ++i) blocks[i] = &parameters[kPoseSize * i];
  const PoseBlock own_block = ToBlock(eliminated_pose);
  if (options_.has_eliminated_pose) blocks[num_shared] = own_block.data();
  return view.loop->Evaluate(blocks.data(), left_from_tangent);
}

std::optional<TargetShape> CapturesCost::ShapeAt(const std::vector<double>& parameters) const {
  std::optional<TargetShape> shape = options_.shape;
  if (shape) std::copy_n(ParamsAt(parameters) + NumParams(model_), TargetShape::kNumParams, shape->params.begin());
  return shape;
}

const double* CapturesCost::ParamsAt(const std::vector<double>& parameters) const {
  return &parameters[static_cast<size_t>(kPoseSize * num_shared_poses_)];
}

bool CapturesCost::WriteCapture(const CaptureTerm& capture, const std::vector<double>& parameters,
                                std::vector<Matrix6>* left_from_tangent, ViewRows* rows) const {
  const CaptureView& view = capture.views.front();
  const Rigid3d camera_from_target = CameraFromTargetOf(view, parameters, {}, left_from_tangent);
  const std::optional<TargetShape> shape = ShapeAt(parameters);
  return reducer_.Write(ParamsAt(parameters), camera_from_target, *view.observations, shape ? &*shape : nullptr, rows);
}

bool CapturesCost::EvaluateCapture(const ViewReducer& reducer, const CaptureTerm& capture,
                                   const std::vector<double>& parameters, Evaluation* evaluation) const {
  const std::optional<TargetShape> shape = ShapeAt(parameters);
  for (const CaptureView& view : capture.views) {
    const bool is_first = &view == &capture.views.front();
    const Rigid3d camera_from_target = CameraFromTargetOf(view, parameters, evaluation->eliminated_pose,
                                                          is_first ? &evaluation->left_from_tangent : nullptr);
    ViewNormalEquations further;
    if (!reducer.Multiply(ParamsAt(parameters), camera_from_target, *view.observations, shape ? &*shape : nullptr,
                          is_first ? &evaluation->products : &further)) {
      return false;
    }
    if (is_first) continue;
    evaluation->products.matrix += further.matrix;
    evaluation->products.loss_remainder += further.loss_remainder;
  }
  if (!options_.has_eliminated_pose) return true;
  const Matrix6& left_from_own = evaluation->left_from_tangent.back();
  evaluation->with_others = left_from_own.transpose().lazyProduct(evaluation->products.matrix.topRows<6>());
  evaluation->own = evaluation->with_others.leftCols<6>() * left_from_own;
  if (options_.eliminated_pose_prior) {
    const CorrectionPrior prior = CorrectionPriorAt(evaluation->eliminated_pose, *options_.eliminated_pose_prior);
    evaluation->own += prior.by_tangent.transpose() * prior.by_tangent;
    evaluation->with_others.rightCols<1>() += prior.by_tangent.transpose() * prior.residual;
    evaluation->prior_squares = prior.residual.squaredNorm();
  }
  return true;
}

// Refines the eliminated pose by damped Gauss-Newton steps with all other unknowns held.
bool CapturesCost::SolveEliminatedPose(const CaptureTerm& capture, const std::vector<double>& parameters,
                                       Evaluation* evaluation) const {
  constexpr int kMaxSteps = 30;
  constexpr double kSettled = 1e-2;  // Relative to the cost; the joint solve does the rest.
  constexpr double kLeastDamping = 1e-6;
  double damping = kLeastDamping;
  // A rough pose will hardly be kept, so the columns of the other parameters are not needed there.
  bool has_all_columns = !(options_.eliminated_poses_are_rough && accepted_ == nullptr);
  if (!EvaluateCapture(has_all_columns ? reducer_ : pose_reducer_, capture, parameters, evaluation)) return false;
  for (int i = 0; i < kMaxSteps; ++i) {
    const auto gradient = evaluation->with_others.rightCols<1>();
    Matrix6 damped = evaluation->own;
    damped.diagonal() *= 1 + damping;
    const Tangent6 step = -damped.ldlt().solve(gradient);
    if (!(-step.dot(gradient) > kSettled * evaluation->Cost())) break;
    Evaluation moved;
    moved.eliminated_pose = Retract(evaluation->eliminated_pose, step);
    if (EvaluateCapture(reducer_, capture, parameters, &moved) && moved.Cost() < evaluation->Cost()) {
      *evaluation = std::move(moved);
      has_all_columns = true;
      damping = std::max(kLeastDamping, 0.1 * damping);
    } else {
      damping *= 10;
    }
  }
  return has_all_columns || EvaluateCapture(reducer_, capture, parameters, evaluation);
}

std::vector<Rigid3d> CapturesCost::EliminatedPoses() const {
  std::vector<Rigid3d> poses;
  if (accepted_ == nullptr) return poses;
  Evaluation moved;
  for (size_t i = 0; i < accepted_->own_poses.size(); ++i) {
    const EliminatedPoseState& own = accepted_->own_poses[i];
    moved.eliminated_pose = Retract(own.pose, -Tangent6(own.step.rightCols<1>()));
    // Takes the remaining step to the optimum if it is a small fraction of the noise or does not increase the cost.
    constexpr double kSmallDrop = 1e-3;
    const bool is_better = own.predicted_drop < kSmallDrop * std::min(own.cost, 1.0) ||
                           (EvaluateCapture(pose_reducer_, captures_[i], accepted_->shared.parameters, &moved) &&
                            moved.Cost() <= own.cost);
    poses.push_back(is_better ? moved.eliminated_pose : own.pose);
  }
  return poses;
}

}  // namespace heba
