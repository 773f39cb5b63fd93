#include "solvers/uncertainty/linearisation.h"

#include <numeric>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

// Returns the same measurements in no more rows than columns, from the triangular factor of [effects, unknowns,
// offset]: its last row depends on the offset alone and is independent of the others.
LinearisedView Condensed(const LinearisedView& view) {
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index num_effects = view.by_effects.cols();
  const Eigen::Index rows = num_effects + n;
  if (view.offset.size() <= rows + 1) return view;
  Eigen::MatrixXd all(view.offset.size(), rows + 1);
  all << view.by_effects, view.by_unknowns, view.offset;
  const Eigen::MatrixXd factor = HouseholderFactor(std::move(all)).R();
  LinearisedView condensed;
  condensed.by_effects = factor.topLeftCorner(rows, num_effects);
  condensed.num_combined_effects = view.num_combined_effects;
  condensed.by_unknowns = factor.block(0, num_effects, rows, n);
  condensed.offset = factor.col(rows).head(rows);
  condensed.num_rows_without_effects = n;
  condensed.residual_sum_of_squares = view.residual_sum_of_squares + factor(rows, rows) * factor(rows, rows);
  condensed.num_residual_dof = view.num_residual_dof + static_cast<int>(view.offset.size() - rows);
  return condensed;
}

// Stacks the rows of views that share their effects.
LinearisedView Stack(const std::vector<LinearisedView>& views, const std::vector<size_t>& group) {
  LinearisedView stacked;
  Eigen::Index num_rows = 0;
  for (const size_t i : group) {
    num_rows += views[i].offset.size();
    stacked.num_rows_without_effects += views[i].num_rows_without_effects;
    stacked.residual_sum_of_squares += views[i].residual_sum_of_squares;
    stacked.num_residual_dof += views[i].num_residual_dof;
  }
  stacked.by_unknowns.resize(num_rows, views[group.front()].by_unknowns.cols());
  stacked.by_effects.resize(num_rows, views[group.front()].by_effects.cols());
  stacked.num_combined_effects = views[group.front()].num_combined_effects;
  stacked.offset.resize(num_rows);
  // Rows that depend on the effects come before those that do not.
  Eigen::Index dependent = 0;
  Eigen::Index independent = num_rows - stacked.num_rows_without_effects;
  for (const size_t i : group) {
    const LinearisedView& view = views[i];
    const Eigen::Index num_dependent = view.offset.size() - view.num_rows_without_effects;
    const Eigen::Index num_independent = view.num_rows_without_effects;
    stacked.by_unknowns.middleRows(dependent, num_dependent) = view.by_unknowns.topRows(num_dependent);
    stacked.by_effects.middleRows(dependent, num_dependent) = view.by_effects.topRows(num_dependent);
    stacked.offset.segment(dependent, num_dependent) = view.offset.head(num_dependent);
    stacked.by_unknowns.middleRows(independent, num_independent) = view.by_unknowns.bottomRows(num_independent);
    stacked.by_effects.middleRows(independent, num_independent) = view.by_effects.bottomRows(num_independent);
    stacked.offset.segment(independent, num_independent) = view.offset.tail(num_independent);
    dependent += num_dependent;
    independent += num_independent;
  }
  return Condensed(stacked);
}

// Linearises one view. by_unknowns and by_effects are the negated derivatives of the residuals.
class ViewLinearisation {
 public:
  // `points` may be null.
  ViewLinearisation(const LoopProblem& problem, const LoopValues& values, double pixel_sigma_px, const Loss& loss,
                    const std::vector<PointUnknowns>* points)
      : problem_(problem),
        values_(values),
        pixel_sigma_px_(pixel_sigma_px),
        points_(points),
        poses_(problem.layout.BlocksOf(UnknownOwner::kPose)),
        effects_(problem.layout.BlocksOf(UnknownOwner::kEffects)),
        cameras_(problem.layout.BlocksOf(UnknownOwner::kCamera)),
        targets_(problem.layout.BlocksOf(UnknownOwner::kTarget)) {
    for (size_t t = 0; points != nullptr && t < points->size(); ++t) num_coefficients_ += (*points)[t].size;
    for (size_t c = 0; c < cameras_.size(); ++c) {
      for (size_t t = 0; t < targets_.size(); ++t) {
        reducers_.emplace_back(*problem.cameras[c], FreeOf(problem, static_cast<int>(c), static_cast<int>(t)),
                               PixelSigmaOf(problem, c, pixel_sigma_px), loss);
      }
    }
  }

  std::optional<LinearisedView> At(const LoopView& view, const std::vector<NuisancePose>& own) const {
    std::vector<Rigid3d> nuisance_poses;
    Eigen::Index num_effects = 0;
    for (const NuisancePose& nuisance_pose : own) {
      nuisance_poses.push_back(nuisance_pose.pose);
      num_effects += 6 + nuisance_pose.directions.cols();
    }
    const auto camera = static_cast<size_t>(view.camera);
    const auto target = static_cast<size_t>(view.target);
    LoopDerivatives derivatives;
    const Rigid3d camera_from_target =
        view.loop.Evaluate({values_.poses, values_.effects, nuisance_poses}, &derivatives);
    SquareRootInformation reduction;
    const bool is_projected = points_ != nullptr
                                  ? WriteWithPoints(view, camera_from_target, &reduction)
                                  : Reducer(view).Reduce(values_.cameras[camera].data(), camera_from_target,
                                                         *view.observations, ShapeOf(view), &reduction);
    if (!is_projected) return std::nullopt;
    WeighPoseRows(view.pose_variance_ratio, &reduction.factor);
    LinearisedView linear;
    const Eigen::Index columns = reduction.factor.cols() - 1;
    Eigen::Index rows = reduction.factor.rows();
    Eigen::Index num_moved = rows;  // Rows that depend on the pose.
    if (points_ == nullptr && 2 * view.observations->size() > rows) {
      // The factor is square: its last row contains only the residual that no unknown can explain.
      rows = columns;
      num_moved = 6;
      linear.residual_sum_of_squares = reduction.factor(columns, columns) * reduction.factor(columns, columns);
      linear.num_residual_dof = 2 * view.observations->size() - static_cast<int>(columns);
    }
    linear.num_rows_without_effects = rows - num_moved;
    const auto by_pose = reduction.factor.topLeftCorner(num_moved, 6);
    linear.by_unknowns.setZero(rows, problem_.layout.size() + num_coefficients_);
    linear.by_effects.setZero(rows, num_effects);
    linear.num_combined_effects = num_effects - 6 * static_cast<Eigen::Index>(own.size());
    linear.offset = reduction.factor.col(columns).head(rows);
    for (size_t k = 0; k < view.loop.shared().size(); ++k) {
      const Eigen::Index first = poses_[static_cast<size_t>(view.loop.shared()[k])].first;
      linear.by_unknowns.block(0, first, num_moved, 6) = -by_pose.lazyProduct(derivatives.shared[k]);
    }
    for (size_t e = 0; e < view.loop.effects().size(); ++e) {
      const auto index = static_cast<size_t>(view.loop.effects()[e]);
      auto by_effects = linear.by_unknowns.block(0, effects_[index].first, num_moved, effects_[index].size);
      by_effects = -by_pose.lazyProduct(derivatives.effects[e]);
      linear.offset.head(num_moved) += by_effects * values_.effects[index];
    }
    const UnknownBlock& of_camera = cameras_[camera];
    const UnknownBlock& of_target = targets_[target];
    linear.by_unknowns.middleCols(of_camera.first, of_camera.size) =
        -reduction.factor.block(0, 6, rows, of_camera.size);
    linear.by_unknowns.middleCols(of_target.first, of_target.size) =
        -reduction.factor.block(0, 6 + of_camera.size, rows, of_target.size);
    linear.by_unknowns.rightCols(num_coefficients_) =
        -reduction.factor.block(0, 6 + of_camera.size + of_target.size, rows, num_coefficients_);
    for (size_t j = 0; j < view.loop.own().size(); ++j) {
      const int index = view.loop.own()[j];
      auto by_own = linear.by_effects.block(0, 6 * index, num_moved, 6);
      by_own = -by_pose.lazyProduct(derivatives.own[j]);
      linear.offset.head(num_moved) +=
          by_own.lazyProduct(LocalCoordinates(Rigid3d(), nuisance_poses[static_cast<size_t>(index)]));
    }
    // The columns of the directions come after those of all nuisance poses.
    Eigen::Index first = 6 * static_cast<Eigen::Index>(own.size());
    for (size_t j = 0; j < own.size(); ++j) {
      const Matrix6X& directions = own[j].directions;
      const auto by_own = linear.by_effects.block(0, 6 * static_cast<Eigen::Index>(j), num_moved, 6);
      linear.by_effects.block(0, first, num_moved, directions.cols()) = by_own.lazyProduct(directions);
      first += directions.cols();
    }
    return linear;
  }

 private:
  const ViewReducer& Reducer(const LoopView& view) const {
    return reducers_[static_cast<size_t>(view.camera) * targets_.size() + static_cast<size_t>(view.target)];
  }
  const TargetShape* ShapeOf(const LoopView& view) const {
    const auto target = static_cast<size_t>(view.target);
    return targets_[target].size > 0 ? &values_.targets[target] : nullptr;
  }

  // Sets all rows of a view, with the columns of the points' coefficients before the residual.
  bool WriteWithPoints(const LoopView& view, const Rigid3d& camera_from_target,
                       SquareRootInformation* reduction) const {
    const double* const params = values_.cameras[static_cast<size_t>(view.camera)].data();
    const Observations& observations = *view.observations;
    const PointUnknowns& points = (*points_)[static_cast<size_t>(view.target)];
    ViewRows rows;
    if (!Reducer(view).Write(params, camera_from_target, observations, ShapeOf(view), &rows)) return false;
    const Eigen::Index num_before = Reducer(view).num_columns() - 1;
    reduction->factor = Eigen::MatrixXd::Zero(rows.size, num_before + num_coefficients_ + 1);
    reduction->factor.leftCols(num_before) = rows.columns.topLeftCorner(rows.size, num_before);
    reduction->factor.rightCols<1>() = rows.columns.col(num_before).head(rows.size);
    if (points.size == 0) return true;
    const auto camera = static_cast<size_t>(view.camera);
    const std::optional<Eigen::MatrixXd> by_points =
        RowsByPoints(*problem_.cameras[camera], params, camera_from_target, observations, ShapeOf(view),
                     PixelSigmaOf(problem_, camera, pixel_sigma_px_));
    if (!by_points) return false;
    auto by_coefficients = reduction->factor.middleCols(num_before + points.first, points.size);
    for (Eigen::Index i = 0; i < observations.size(); ++i) {
      const auto found = points.by_id.find(observations.ids[static_cast<size_t>(i)]);
      if (found != points.by_id.end()) by_coefficients += by_points->middleCols(3 * i, 3) * found->second;
    }
    return true;
  }

  const LoopProblem& problem_;
  const LoopValues& values_;
  double pixel_sigma_px_;
  const std::vector<PointUnknowns>* points_;
  Eigen::Index num_coefficients_ = 0;
  std::vector<UnknownBlock> poses_;
  std::vector<UnknownBlock> effects_;
  std::vector<UnknownBlock> cameras_;
  std::vector<UnknownBlock> targets_;
  std::vector<ViewReducer> reducers_;  // One for each pair of camera and target.
};

}  // namespace

namespace {

std::optional<std::vector<LinearisedView>> Linearise(const LoopProblem& problem,
                                                     const ViewLinearisation& linearisation) {
  std::vector<LinearisedView> result;
  for (const LoopCapture& capture : problem.captures) {
    std::vector<LinearisedView> views;
    for (const LoopView& view : capture.views) {
      std::optional<LinearisedView> linear = linearisation.At(view, capture.nuisance_poses);
      if (!linear) return std::nullopt;
      views.push_back(std::move(*linear));
    }
    if (views.size() == 1) {
      result.push_back(std::move(views.front()));
      continue;
    }
    std::vector<size_t> all(views.size());
    std::iota(all.begin(), all.end(), size_t{0});
    result.push_back(Stack(views, all));
  }
  return result;
}

}  // namespace

std::optional<std::vector<LinearisedView>> LineariseCaptures(const LoopProblem& problem, const LoopValues& values,
                                                             double pixel_sigma_px, const Loss& loss) {
  return Linearise(problem, ViewLinearisation(problem, values, pixel_sigma_px, loss, nullptr));
}

std::optional<std::vector<LinearisedView>> LineariseWithPoints(const LoopProblem& problem, const LoopValues& values,
                                                               const std::vector<PointUnknowns>& points) {
  return Linearise(problem, ViewLinearisation(problem, values, 1, LossOf(LossKind::kNone), &points));
}

std::vector<LinearisedView> StackGroups(const std::vector<LinearisedView>& views, const PoseGroups& groups) {
  std::vector<LinearisedView> stacked;
  size_t num_grouped = 0;
  for (const std::vector<size_t>& group : groups) {
    num_grouped += group.size();
    stacked.push_back(group.size() == 1 ? views[group.front()] : Stack(views, group));
  }
  stacked.insert(stacked.end(), views.begin() + static_cast<std::ptrdiff_t>(num_grouped), views.end());
  return stacked;
}

}  // namespace heba
