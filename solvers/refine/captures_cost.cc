#include "solvers/refine/captures_cost.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Cholesky>

#include "heba/base/error.h"
#include "heba/base/levenberg_marquardt.h"
#include "heba/base/parallel.h"
#include "heba/geometry/pose_block.h"
#include "heba/kernels/small_matrix.h"

namespace heba {
namespace {

// Captures are summed in groups that do not depend on the number of threads; neither do the digits of the result.
constexpr int kMaxGroups = 32;
constexpr int kCapturesPerGroup = 16;

}  // namespace

// The views of one camera and one target.
struct CapturesCost::ViewKind {
  ViewReducer reducer;
  ViewReducer pose_reducer;  // Has columns for the pose only.
  bool has_shape = false;
  ColumnPlaces places;
};

// One view at one value of all unknowns.
struct CapturesCost::ViewTerms {
  LoopDerivatives derivatives;
  ViewNormalEquations products;
};

// One capture at one value of all unknowns.
struct CapturesCost::CaptureTerms {
  std::vector<Rigid3d> nuisance_poses;
  std::vector<ViewTerms> views;
  bool has_all_columns = false;
  // The normal equations of the nuisance poses, with their priors.
  NuisanceMatrix normal;
  NuisanceVector gradient;
  NuisanceVector prior_gradient;
  double prior_squares = 0;
  double cost = 0;
};

// A capture's eliminated poses where the cost was evaluated.
struct CapturesCost::EliminatedState {
  std::vector<Rigid3d> poses;
  double cost = 0;            // Cost of the capture at these poses.
  double predicted_drop = 0;  // Predicted decrease of that cost by a step of these poses alone.
  // The best step of the poses is -step * [step of the shared unknowns, 1].
  Eigen::MatrixXd step;
};

// All captures, evaluated at one value of the shared unknowns.
struct CapturesCost::State {
  NormalEquations shared;
  std::vector<EliminatedState> eliminated;  // Empty if the captures have no nuisance poses.

  double Cost() const {
    return std::max(0.0, shared.matrix(shared.matrix.rows() - 1, shared.matrix.cols() - 1)) + shared.loss_remainder;
  }
};

CapturesCost::CapturesCost(LoopProblem problem, CapturesCostOptions options)
    : problem_(std::move(problem)),
      options_(std::move(options)),
      blocks_(ParameterBlocksOf(problem_.layout)),
      pose_blocks_(problem_.layout.BlocksOf(UnknownOwner::kPose)),
      effect_blocks_(problem_.layout.BlocksOf(UnknownOwner::kEffects)),
      num_columns_(problem_.layout.size() + 1) {
  CHECK(!problem_.captures.empty());
  const std::vector<UnknownBlock> cameras = problem_.layout.BlocksOf(UnknownOwner::kCamera);
  const std::vector<UnknownBlock> targets = problem_.layout.BlocksOf(UnknownOwner::kTarget);
  CHECK_EQ(cameras.size(), problem_.cameras.size());
  CHECK_EQ(targets.size(), problem_.targets.size());
  CHECK(std::is_sorted(problem_.layout.blocks().begin(), problem_.layout.blocks().end(),
                       [](const UnknownBlock& a, const UnknownBlock& b) { return a.owner < b.owner; }));
  for (const OwnerBlock& block : blocks_) mutable_parameter_block_sizes()->push_back(block.size);
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (size_t t = 0; t < targets.size(); ++t) {
      const FreeParameters free = FreeOf(problem_, static_cast<int>(c), static_cast<int>(t));
      const CameraModel& model = *problem_.cameras[c];
      const double sigma_px = PixelSigmaOf(problem_, c, options_.pixel_sigma_px);
      kinds_.push_back({ViewReducer(model, free, sigma_px, *options_.loss),
                        ViewReducer(model, FreeParameters(free.size(), false), sigma_px, *options_.loss),
                        targets[t].size > 0,
                        {}});
      kinds_.back().places.Append(cameras[c].first, cameras[c].size);
      kinds_.back().places.Append(targets[t].first, targets[t].size);
      kinds_.back().places.Append(problem_.layout.size(), 1);
    }
  }
  int num_points = 0;
  for (const LoopCapture& capture : problem_.captures) {
    CHECK(!capture.views.empty());
    CHECK_LE(capture.nuisance_poses.size(), static_cast<size_t>(kMaxNuisancePoses));
    has_eliminated_poses_ = has_eliminated_poses_ || !capture.nuisance_poses.empty();
    for (const LoopView& view : capture.views) num_points += view.observations->size();
  }
  options_.num_threads = ThreadsFor(num_points, options_.num_threads);
  // One more row holds the difference between the sum of rho and the weighted sum of squares.
  set_num_residuals(static_cast<int>(num_columns_) + 1);
}

CapturesCost::~CapturesCost() = default;

const CapturesCost::ViewKind& CapturesCost::KindOf(const LoopView& view) const {
  return kinds_[static_cast<size_t>(view.camera) * problem_.targets.size() + static_cast<size_t>(view.target)];
}

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
  for (size_t b = 0; b < blocks_.size(); ++b) {
    if (jacobians[b] == nullptr) continue;
    const UnknownBlock& unknowns = blocks_[b].unknowns;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> jacobian(
        jacobians[b], num_residuals(), blocks_[b].size);
    jacobian.setZero();
    if (unknowns.owner == UnknownOwner::kPose) {
      jacobian.topRows(root.rows()) = root.middleCols<6>(unknowns.first) * TangentFromBlock(parameters[b]);
      continue;
    }
    for (Eigen::Index i = unknowns.first; i < unknowns.end(); ++i) {
      jacobian.col(problem_.layout[i].index).head(root.rows()) = root.col(i);
    }
  }
  // Ceres evaluates Jacobians only where it stays.
  accepted_ = candidate_;
  predicted_drop_ = root.col(root.cols() - 1).head(root.rows() - 1).squaredNorm();
  for (const EliminatedState& own : accepted_->eliminated) predicted_drop_ += own.predicted_drop;
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
  for (size_t b = 0; b < blocks_.size(); ++b) {
    joined.insert(joined.end(), parameters[b], parameters[b] + blocks_[b].size);
  }
  return joined;
}

Eigen::VectorXd CapturesCost::Step(const std::vector<double>& from, const std::vector<double>& to) const {
  Eigen::VectorXd step(problem_.layout.size());
  for (const OwnerBlock& block : blocks_) {
    const UnknownBlock& unknowns = block.unknowns;
    if (unknowns.owner == UnknownOwner::kPose) {
      step.segment<6>(unknowns.first) = LocalCoordinates(FromBlock(&from[block.first]), FromBlock(&to[block.first]));
      continue;
    }
    for (Eigen::Index i = unknowns.first; i < unknowns.end(); ++i) {
      const size_t param = block.first + static_cast<size_t>(problem_.layout[i].index);
      step[i] = to[param] - from[param];
    }
  }
  return step;
}

std::optional<NormalEquations> CapturesCost::NormalEquationsAt(const double* const* parameters) const {
  State state;
  if (!EvaluateAll(Joined(parameters), &state)) return std::nullopt;
  return std::move(state.shared);
}

bool CapturesCost::EvaluateAll(std::vector<double> parameters, State* state) const {
  state->shared.parameters = std::move(parameters);
  const LoopValues at = ValuesIn(blocks_, state->shared.parameters, problem_.targets);
  Eigen::VectorXd step;
  if (has_eliminated_poses_) {
    state->eliminated.resize(problem_.captures.size());
    if (accepted_ != nullptr) step = Step(accepted_->shared.parameters, state->shared.parameters);
  }

  const int num_captures = static_cast<int>(problem_.captures.size());
  const int num_groups = std::clamp(num_captures / kCapturesPerGroup, 1, kMaxGroups);
  std::vector<NormalEquations> sums(static_cast<size_t>(num_groups));
  std::vector<char> has_failed(static_cast<size_t>(num_groups), 0);
  ParallelFor(num_groups, options_.num_threads, [&](int index) {
    const auto first_of = [&](int g) {
      return static_cast<size_t>(static_cast<int64_t>(num_captures) * g / num_groups);
    };
    const auto group = static_cast<size_t>(index);
    has_failed[group] = !EvaluateGroup(first_of(index), first_of(index + 1), at, step, state, &sums[group]);
  });
  if (std::find(has_failed.begin(), has_failed.end(), 1) != has_failed.end()) return false;
  for (size_t group = 1; group < sums.size(); ++group) {
    sums[0].matrix += sums[group].matrix;
    sums[0].loss_remainder += sums[group].loss_remainder;
  }
  AddPriors(state->shared.parameters, &sums[0].matrix);
  // Only the lower triangles were summed.
  state->shared.matrix = sums[0].matrix.selfadjointView<Eigen::Lower>();
  state->shared.loss_remainder = sums[0].loss_remainder;
  return true;
}

void CapturesCost::AddPriors(const std::vector<double>& parameters, Eigen::MatrixXd* matrix) const {
  const Eigen::Index residual = num_columns_ - 1;
  for (const BlockPrior& prior : options_.priors) {
    const auto block = std::find_if(blocks_.begin(), blocks_.end(), [&](const OwnerBlock& one) {
      return one.unknowns.owner == prior.owner && one.index == prior.index;
    });
    CHECK(block != blocks_.end() || prior.owner == UnknownOwner::kTarget);
    if (block == blocks_.end()) continue;
    CHECK_EQ(prior.weights.size(), block->size);
    const Eigen::Map<const Eigen::VectorXd> at(&parameters[block->first], block->size);
    const Eigen::VectorXd pull = prior.weights.cwiseProduct(at - prior.mean);
    (*matrix)(residual, residual) += pull.squaredNorm();
    for (Eigen::Index i = block->unknowns.first; i < block->unknowns.end(); ++i) {
      const int index = problem_.layout[i].index;
      (*matrix)(i, i) += prior.weights[index] * prior.weights[index];
      (*matrix)(residual, i) += prior.weights[index] * pull[index];
    }
  }
}

std::vector<Rigid3d> CapturesCost::EliminatedPosesAfter(const Eigen::VectorXd& step, size_t capture) const {
  std::vector<Rigid3d> poses;
  if (accepted_ == nullptr) {
    for (const NuisancePose& own : problem_.captures[capture].nuisance_poses) poses.push_back(own.pose);
    return poses;
  }
  const EliminatedState& before = accepted_->eliminated[capture];
  for (size_t j = 0; j < before.poses.size(); ++j) {
    const auto rows = before.step.middleRows<6>(6 * static_cast<Eigen::Index>(j));
    poses.push_back(Retract(before.poses[j], -(rows.leftCols(step.size()) * step + rows.rightCols<1>())));
  }
  return poses;
}

bool CapturesCost::EvaluateGroup(size_t first, size_t last, const LoopValues& at, const Eigen::VectorXd& step,
                                 State* state, NormalEquations* sum) const {
  ChainedSum group(pose_blocks_, effect_blocks_, num_columns_);
  const bool settles = accepted_ == nullptr;
  ViewRows rows;
  CaptureTerms terms;
  LoopDerivatives derivatives;
  Eigen::MatrixXd own_rows;
  for (size_t i = first; i < last; ++i) {
    const LoopCapture& capture = problem_.captures[i];
    if (capture.nuisance_poses.empty()) {
      for (const LoopView& view : capture.views) {
        const ViewKind& kind = KindOf(view);
        const std::vector<double>& params = at.cameras[static_cast<size_t>(view.camera)];
        const TargetShape* const shape = kind.has_shape ? &at.targets[static_cast<size_t>(view.target)] : nullptr;
        const Rigid3d camera_from_target = view.loop.Evaluate({at.poses, at.effects, {}}, &derivatives);
        if (view.observations->size() <= ChainedSum::kFewPoints && view.pose_variance_ratio == 1) {
          if (!kind.reducer.Write(params.data(), camera_from_target, *view.observations, shape, &rows)) return false;
          group.AddRows(rows, view.loop, derivatives, kind.places);
          group.AddLossRemainder(rows.loss_remainder);
          continue;
        }
        ViewNormalEquations products;
        if (!kind.reducer.Multiply(params.data(), camera_from_target, *view.observations, shape, &products)) {
          return false;
        }
        WeighPosePart(view.pose_variance_ratio, &products.matrix);
        group.AddProducts(products.matrix, view.loop, derivatives, kind.places);
        group.AddLossRemainder(products.loss_remainder);
      }
      continue;
    }
    std::vector<Rigid3d> start = EliminatedPosesAfter(step, i);
    bool is_evaluated = settles ? SolveEliminatedPoses(capture, at, std::move(start), &terms)
                                : EvaluateCapture(capture, at, std::move(start), true, &terms);
    if (!is_evaluated && !settles) {
      // A point cannot be projected from the predicted poses: refine from the accepted poses instead.
      is_evaluated = SolveEliminatedPoses(capture, at, accepted_->eliminated[i].poses, &terms);
    }
    if (!is_evaluated) return false;
    own_rows.setZero(terms.normal.rows(), num_columns_);
    own_rows.rightCols<1>() = terms.prior_gradient;
    for (size_t v = 0; v < capture.views.size(); ++v) {
      const LoopView& view = capture.views[v];
      const ViewTerms& of_view = terms.views[v];
      group.AddProducts(of_view.products.matrix, view.loop, of_view.derivatives, KindOf(view).places);
      group.AddOwnRows(of_view.products.matrix, view.loop, of_view.derivatives, KindOf(view).places, &own_rows);
      group.AddLossRemainder(of_view.products.loss_remainder);
    }
    EliminatedState& own = state->eliminated[i];
    own.poses = std::move(terms.nuisance_poses);
    own.cost = terms.cost;
    own.step = group.Eliminate(terms.normal, own_rows);
    own.predicted_drop = own_rows.rightCols<1>().dot(own.step.rightCols<1>());
    group.AddSquares(terms.prior_squares);
  }
  ChainedSum::Result result = group.Finish();
  sum->matrix = std::move(result.matrix);
  sum->loss_remainder = result.loss_remainder;
  return true;
}

bool CapturesCost::EvaluateCapture(const LoopCapture& capture, const LoopValues& at,
                                   std::vector<Rigid3d> nuisance_poses, bool has_all_columns,
                                   CaptureTerms* terms) const {
  terms->nuisance_poses = std::move(nuisance_poses);
  terms->has_all_columns = has_all_columns;
  terms->views.resize(capture.views.size());
  const Eigen::Index size = 6 * static_cast<Eigen::Index>(capture.nuisance_poses.size());
  terms->normal.setZero(size, size);
  terms->gradient.setZero(size);
  terms->prior_gradient.setZero(size);
  terms->prior_squares = 0;
  terms->cost = 0;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const LoopView& view = capture.views[v];
    ViewTerms& of_view = terms->views[v];
    const ViewKind& kind = KindOf(view);
    const Rigid3d camera_from_target =
        view.loop.Evaluate({at.poses, at.effects, terms->nuisance_poses}, &of_view.derivatives);
    const ViewReducer& reducer = has_all_columns ? kind.reducer : kind.pose_reducer;
    if (!reducer.Multiply(at.cameras[static_cast<size_t>(view.camera)].data(), camera_from_target, *view.observations,
                          kind.has_shape ? &at.targets[static_cast<size_t>(view.target)] : nullptr,
                          &of_view.products)) {
      return false;
    }
    WeighPosePart(view.pose_variance_ratio, &of_view.products.matrix);
    const Eigen::MatrixXd& products = of_view.products.matrix;
    const Eigen::Index residual = products.cols() - 1;
    const Matrix6 by_pose = products.topLeftCorner<6, 6>();
    const Tangent6 pull = products.col(residual).head<6>();
    for (size_t j = 0; j < view.loop.own().size(); ++j) {
      const Eigen::Index row = 6 * view.loop.own()[j];
      const Matrix6 half = of_view.derivatives.own[j].transpose() * by_pose;
      for (size_t k = 0; k < view.loop.own().size(); ++k) {
        terms->normal.block<6, 6>(row, 6 * view.loop.own()[k]).noalias() += half * of_view.derivatives.own[k];
      }
      terms->gradient.segment<6>(row).noalias() += of_view.derivatives.own[j].transpose() * pull;
    }
    terms->cost += products(residual, residual) + of_view.products.loss_remainder;
  }
  for (size_t j = 0; j < capture.nuisance_poses.size(); ++j) {
    if (!capture.nuisance_poses[j].prior) continue;
    const Eigen::Index row = 6 * static_cast<Eigen::Index>(j);
    const NuisancePoseResidual prior =
        NuisancePoseResidualAt(terms->nuisance_poses[j], problem_.priors[*capture.nuisance_poses[j].prior]);
    const Matrix6 of_prior = prior.by_tangent.transpose() * prior.by_tangent;
    terms->normal.block<6, 6>(row, row) += of_prior;
    terms->prior_gradient.segment<6>(row).noalias() = prior.by_tangent.transpose() * prior.residual;
    terms->prior_squares += prior.residual.squaredNorm();
  }
  terms->gradient += terms->prior_gradient;
  terms->cost += terms->prior_squares;
  return true;
}

bool CapturesCost::SolveEliminatedPoses(const LoopCapture& capture, const LoopValues& at,
                                        std::vector<Rigid3d> nuisance_poses, CaptureTerms* terms) const {
  LevenbergMarquardtOptions options;
  options.max_iterations = 30;
  options.initial_damping = 1e-6;
  options.least_damping = 1e-6;
  options.small_drop = 1e-2;  // The joint solve does the rest.
  // A rough pose will hardly be kept, so the columns of the other parameters are not needed there.
  const bool is_rough = options_.eliminated_poses_are_rough && accepted_ == nullptr;
  if (!EvaluateCapture(capture, at, std::move(nuisance_poses), !is_rough, terms)) return false;
  const auto try_step = [&](const CaptureTerms& here, const NuisanceVector& step) {
    std::optional<CaptureTerms> next(std::in_place);
    std::vector<Rigid3d> moved;
    for (size_t j = 0; j < here.nuisance_poses.size(); ++j) {
      moved.push_back(Retract(here.nuisance_poses[j], step.segment<6>(6 * static_cast<Eigen::Index>(j))));
    }
    if (!EvaluateCapture(capture, at, std::move(moved), true, &*next)) next.reset();
    return next;
  };
  MinimiseSquares(options, try_step, terms);
  return terms->has_all_columns || EvaluateCapture(capture, at, std::move(terms->nuisance_poses), true, terms);
}

std::vector<std::vector<Rigid3d>> CapturesCost::EliminatedPoses() const {
  std::vector<std::vector<Rigid3d>> poses;
  if (accepted_ == nullptr) return poses;
  const LoopValues at = ValuesIn(blocks_, accepted_->shared.parameters, problem_.targets);
  CaptureTerms terms;
  for (size_t i = 0; i < accepted_->eliminated.size(); ++i) {
    const EliminatedState& own = accepted_->eliminated[i];
    std::vector<Rigid3d> moved;
    for (size_t j = 0; j < own.poses.size(); ++j) {
      moved.push_back(Retract(own.poses[j],
                              -Tangent6(own.step.col(num_columns_ - 1).segment<6>(6 * static_cast<Eigen::Index>(j)))));
    }
    // Takes the remaining step to the optimum if it is a small fraction of the noise or does not increase the cost.
    constexpr double kSmallDrop = 1e-3;
    const bool is_better = own.predicted_drop < kSmallDrop * std::min(own.cost, 1.0) ||
                           (EvaluateCapture(problem_.captures[i], at, moved, false, &terms) && terms.cost <= own.cost);
    poses.push_back(is_better ? moved : own.poses);
  }
  return poses;
}

}  // namespace heba
