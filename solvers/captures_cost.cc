#include "solvers/captures_cost.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Cholesky>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/geometry/pose_block.h"
#include "solvers/robot_noise.h"
#include "solvers/view_reduction.h"

namespace heba {
namespace {

// How the captures are summed, whatever the number of threads: so the digits do not depend on it.
constexpr int kMaxGroups = 32;
constexpr int kCapturesPerGroup = 16;

constexpr int kPoseSize = 7;

using PoseRows = Eigen::Matrix<double, 6, Eigen::Dynamic>;

}  // namespace

// A capture at some value of its own pose.
struct CapturesCost::Evaluation {
  Rigid3d own_pose;
  std::vector<Matrix6> left_from_tangent;  // Of the shared poses, then of its own.
  ViewProducts products;
  // Of the own pose: what its step is solved from, 6 x 6, and 6 rows with the products' other columns.
  Matrix6 own;
  PoseRows with_others;
  double prior_squares = 0;

  double Cost() const {
    return products.matrix(products.matrix.rows() - 1, products.matrix.rows() - 1) + products.loss_remainder +
           prior_squares;
  }
};

// What is known of a capture's own pose where the cost was evaluated.
struct CapturesCost::OwnPoseState {
  Rigid3d pose;
  std::vector<Matrix6> left_from_tangent;
  double cost = 0;  // Of the capture, there.
  // Its best step is minus this times [the left perturbation by the shared poses' steps, the free parameters' step, 1].
  PoseRows step;
};

struct CapturesCost::State {
  std::vector<double> parameters;
  std::vector<OwnPoseState> own_poses;  // Empty if captures have none.
  Eigen::MatrixXd products;             // Of the shared poses' tangents, the free parameters, the residual.
  double loss_remainder = 0;
};

CapturesCost::CapturesCost(const CameraModel& model, std::vector<CaptureTerm> captures, CapturesCostOptions options)
    : model_(model),
      captures_(std::move(captures)),
      options_(std::move(options)),
      num_params_(NumParams(model) + (options_.shape ? TargetShape::kNumParams : 0)) {
  CHECK(!captures_.empty());
  CHECK_EQ(options_.free.size(), static_cast<size_t>(num_params_));
  for (int i = 0; i < num_params_; ++i) {
    if (options_.free[static_cast<size_t>(i)]) free_.push_back(i);
  }
  int num_points = 0;
  for (const CaptureTerm& capture : captures_) num_points += capture.observations->size();
  options_.num_threads = ThreadsFor(num_points, options_.num_threads);
  num_shared_poses_ = captures_.front().chain->num_blocks() - (options_.has_own_pose ? 1 : 0);
  for (int i = 0; i < num_shared_poses_; ++i) mutable_parameter_block_sizes()->push_back(kPoseSize);
  mutable_parameter_block_sizes()->push_back(num_params_);
  // One more row holds what the loss adds to the weighted sum of squares.
  set_num_residuals(6 * num_shared_poses_ + static_cast<int>(free_.size()) + 2);
}

CapturesCost::~CapturesCost() = default;

bool CapturesCost::Evaluate(const double* const* parameters, double* residuals, double** jacobians) const {
  std::vector<double> at = Joined(parameters);
  if (candidate_ == nullptr || candidate_->parameters != at) {
    const auto state = std::make_shared<State>();
    if (!EvaluateAll(std::move(at), state.get())) return false;
    candidate_ = state;
  }
  Eigen::Map<Eigen::VectorXd> residual(residuals, num_residuals());
  if (jacobians == nullptr) {
    // The cost alone.
    const double squares = candidate_->products(candidate_->products.rows() - 1, candidate_->products.cols() - 1);
    residual.setZero();
    residual[0] = std::sqrt(std::max(0.0, squares) + candidate_->loss_remainder);
    return true;
  }
  const Eigen::MatrixXd root = RootOfProducts(candidate_->products);
  residual.head(root.rows()) = root.rightCols<1>();
  residual[root.rows()] = std::sqrt(candidate_->loss_remainder);
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
  // Ceres asks for Jacobians where it stays.
  accepted_ = candidate_;
  return true;
}

std::vector<double> CapturesCost::Joined(const double* const* parameters) const {
  std::vector<double> joined;
  for (int i = 0; i < num_shared_poses_; ++i) joined.insert(joined.end(), parameters[i], parameters[i] + kPoseSize);
  joined.insert(joined.end(), parameters[num_shared_poses_], parameters[num_shared_poses_] + num_params_);
  return joined;
}

std::optional<Eigen::MatrixXd> CapturesCost::ProductsAt(const double* const* parameters) const {
  State state;
  if (!EvaluateAll(Joined(parameters), &state)) return std::nullopt;
  return std::move(state.products);
}

bool CapturesCost::EvaluateAll(std::vector<double> parameters, State* state) const {
  state->parameters = std::move(parameters);
  const std::vector<double>& at = state->parameters;
  const auto num_free = static_cast<Eigen::Index>(free_.size());
  if (options_.has_own_pose) state->own_poses.resize(captures_.size());
  // From where the own poses' linearisation was made, if it was.
  std::vector<Tangent6> pose_steps;
  Eigen::VectorXd params_step;
  if (options_.has_own_pose && accepted_ != nullptr) {
    const std::vector<double>& from = accepted_->parameters;
    for (int i = 0; i < num_shared_poses_; ++i) {
      pose_steps.push_back(LocalCoordinates(FromBlock(&from[static_cast<size_t>(kPoseSize * i)]),
                                            FromBlock(&at[static_cast<size_t>(kPoseSize * i)])));
    }
    params_step.resize(num_free);
    for (Eigen::Index i = 0; i < num_free; ++i) {
      const auto param = static_cast<size_t>(kPoseSize * num_shared_poses_ + free_[static_cast<size_t>(i)]);
      params_step[i] = at[param] - from[param];
    }
  }
  const auto own_pose_of = [&](size_t i) -> Rigid3d {
    if (!options_.has_own_pose) return {};
    if (accepted_ == nullptr) return captures_[i].own_pose;
    const OwnPoseState& before = accepted_->own_poses[i];
    Tangent6 left = Tangent6::Zero();
    for (size_t k = 0; k < pose_steps.size(); ++k) left += before.left_from_tangent[k] * pose_steps[k];
    return Retract(before.pose, -(before.step.leftCols<6>() * left + before.step.middleCols(6, num_free) * params_step +
                                  before.step.rightCols<1>()));
  };

  const bool settles = options_.has_own_pose && options_.settles_own_poses && accepted_ == nullptr;
  const int num_captures = static_cast<int>(captures_.size());
  const int num_groups = std::clamp(num_captures / kCapturesPerGroup, 1, kMaxGroups);
  const Eigen::Index num_shared = 6 * num_shared_poses_;
  const Eigen::Index num_others = num_free + 1;
  std::vector<Eigen::MatrixXd> sums(static_cast<size_t>(num_groups),
                                    Eigen::MatrixXd::Zero(num_shared + num_others, num_shared + num_others));
  std::vector<double> remainders(static_cast<size_t>(num_groups), 0.0);
  std::vector<char> has_failed(static_cast<size_t>(num_groups), 0);
  ParallelFor(num_groups, options_.num_threads, [&](int index) {
    const auto group = static_cast<size_t>(index);
    const auto first_of = [&](int g) {
      return static_cast<size_t>(static_cast<int64_t>(num_captures) * g / num_groups);
    };
    Evaluation evaluation;
    for (size_t i = first_of(index); i < first_of(index + 1); ++i) {
      evaluation.own_pose = own_pose_of(i);
      bool is_evaluated =
          settles ? SettleOwnPose(captures_[i], at, &evaluation) : EvaluateCapture(captures_[i], at, &evaluation);
      if (!is_evaluated && options_.has_own_pose && accepted_ != nullptr) {
        // The linearisation leads to where nothing is seen: from where it was, then, step by step.
        evaluation.own_pose = accepted_->own_poses[i].pose;
        is_evaluated = SettleOwnPose(captures_[i], at, &evaluation);
      }
      if (!is_evaluated) {
        has_failed[group] = 1;
        return;
      }
      Eigen::MatrixXd& products = evaluation.products.matrix;
      remainders[group] += evaluation.products.loss_remainder;
      products(6 + num_free, 6 + num_free) += evaluation.prior_squares;
      if (options_.has_own_pose) {
        OwnPoseState& own = state->own_poses[i];
        own.pose = evaluation.own_pose;
        own.cost = evaluation.Cost() - evaluation.prior_squares;  // Which the products have by now.
        own.step = evaluation.own.ldlt().solve(evaluation.with_others);
        products.noalias() -= evaluation.with_others.transpose().lazyProduct(own.step);
        own.left_from_tangent = std::move(evaluation.left_from_tangent);
      }
      const std::vector<Matrix6>& left_from_tangent =
          options_.has_own_pose ? state->own_poses[i].left_from_tangent : evaluation.left_from_tangent;
      Eigen::MatrixXd& sum = sums[group];
      for (int k = 0; k < num_shared_poses_; ++k) {
        const Matrix6& chain = left_from_tangent[static_cast<size_t>(k)];
        const Matrix6 half = chain.transpose() * products.topLeftCorner<6, 6>();
        for (int l = 0; l <= k; ++l) {
          sum.block<6, 6>(6 * k, 6 * l).noalias() += half * left_from_tangent[static_cast<size_t>(l)];
        }
        sum.block(num_shared, 6 * k, num_others, 6).noalias() += products.block(6, 0, num_others, 6).lazyProduct(chain);
      }
      sum.bottomRightCorner(num_others, num_others) += products.bottomRightCorner(num_others, num_others);
    }
  });
  if (std::find(has_failed.begin(), has_failed.end(), 1) != has_failed.end()) return false;
  for (size_t group = 1; group < sums.size(); ++group) {
    sums[0] += sums[group];
    remainders[0] += remainders[group];
  }
  // The sums' lower triangles are what was added up.
  state->products = sums[0].selfadjointView<Eigen::Lower>();
  state->loss_remainder = remainders[0];
  return true;
}

bool CapturesCost::EvaluateCapture(const CaptureTerm& capture, const std::vector<double>& parameters,
                                   Evaluation* evaluation) const {
  std::vector<const double*> blocks;
  for (int i = 0; i < num_shared_poses_; ++i) blocks.push_back(&parameters[static_cast<size_t>(kPoseSize * i)]);
  const PoseBlock own_block = ToBlock(evaluation->own_pose);
  if (options_.has_own_pose) blocks.push_back(own_block.data());
  const double* const params = &parameters[static_cast<size_t>(kPoseSize * num_shared_poses_)];
  std::optional<TargetShape> shape = options_.shape;
  if (shape) std::copy_n(params + NumParams(model_), TargetShape::kNumParams, shape->params.begin());
  const Rigid3d camera_from_target = capture.chain->Evaluate(blocks.data(), &evaluation->left_from_tangent);
  if (!MultiplyView(model_, params, camera_from_target, *capture.observations, options_.pixel_sigma_px, *options_.loss,
                    options_.free, shape ? &*shape : nullptr, &evaluation->products)) {
    return false;
  }
  if (!options_.has_own_pose) return true;
  const Matrix6& left_from_own = evaluation->left_from_tangent.back();
  evaluation->with_others = left_from_own.transpose().lazyProduct(evaluation->products.matrix.topRows<6>());
  evaluation->own = evaluation->with_others.leftCols<6>() * left_from_own;
  if (options_.own_pose_prior) {
    const CorrectionPrior prior = CorrectionPriorAt(evaluation->own_pose, *options_.own_pose_prior);
    evaluation->own += prior.by_tangent.transpose() * prior.by_tangent;
    evaluation->with_others.rightCols<1>() += prior.by_tangent.transpose() * prior.residual;
    evaluation->prior_squares = prior.residual.squaredNorm();
  }
  return true;
}

// By damped Gauss-Newton steps with all else held.
bool CapturesCost::SettleOwnPose(const CaptureTerm& capture, const std::vector<double>& parameters,
                                 Evaluation* evaluation) const {
  if (!EvaluateCapture(capture, parameters, evaluation)) return false;
  constexpr int kMaxSteps = 30;
  constexpr double kSettled = 1e-4;  // Of the cost: the rest is the joint solve's.
  constexpr double kLeastDamping = 1e-6;
  double damping = kLeastDamping;
  for (int i = 0; i < kMaxSteps; ++i) {
    const auto gradient = evaluation->with_others.rightCols<1>();
    Matrix6 damped = evaluation->own;
    damped.diagonal() *= 1 + damping;
    const Tangent6 step = -damped.ldlt().solve(gradient);
    if (!(-step.dot(gradient) > kSettled * evaluation->Cost())) break;
    Evaluation moved;
    moved.own_pose = Retract(evaluation->own_pose, step);
    if (EvaluateCapture(capture, parameters, &moved) && moved.Cost() < evaluation->Cost()) {
      *evaluation = std::move(moved);
      damping = std::max(kLeastDamping, 0.1 * damping);
    } else {
      damping *= 10;
    }
  }
  return true;
}

std::vector<Rigid3d> CapturesCost::OwnPoses() const {
  std::vector<Rigid3d> poses;
  if (accepted_ == nullptr) return poses;
  Evaluation moved;
  for (size_t i = 0; i < accepted_->own_poses.size(); ++i) {
    const OwnPoseState& own = accepted_->own_poses[i];
    moved.own_pose = Retract(own.pose, -Tangent6(own.step.rightCols<1>()));
    // What is left of the way to the best: unless it leads nowhere.
    const bool is_better = EvaluateCapture(captures_[i], accepted_->parameters, &moved) && moved.Cost() <= own.cost;
    poses.push_back(is_better ? moved.own_pose : own.pose);
  }
  return poses;
}

}  // namespace heba
