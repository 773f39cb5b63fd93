#include "solvers/uncertainty/repeated_poses.h"

#include <algorithm>
#include <numeric>

#include <Eigen/QR>

namespace heba {
namespace {

// Returns the same measurements in no more rows than columns, from the triangular factor of [correction, unknowns,
// offset]: its last row depends on the offset alone and is independent of the others.
LinearisedView Condensed(const LinearisedView& view) {
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index rows = 6 + n;
  if (view.offset.size() <= rows + 1) return view;
  Eigen::MatrixXd all(view.offset.size(), rows + 1);
  all << view.by_correction, view.by_unknowns, view.offset;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(all);
  const Eigen::MatrixXd factor = qr.matrixQR().topRows(rows + 1).triangularView<Eigen::Upper>();
  LinearisedView condensed;
  condensed.by_correction = factor.topLeftCorner(rows, 6);
  condensed.by_unknowns = factor.block(0, 6, rows, n);
  condensed.offset = factor.col(rows).head(rows);
  condensed.num_rows_without_correction = n;
  condensed.residual_sum_of_squares = view.residual_sum_of_squares + factor(rows, rows) * factor(rows, rows);
  condensed.num_residual_dof = view.num_residual_dof + static_cast<int>(view.offset.size() - rows);
  return condensed;
}

// Stacks the rows of a group's views.
LinearisedView Stack(const std::vector<LinearisedView>& views, const std::vector<size_t>& group) {
  LinearisedView stacked;
  Eigen::Index num_rows = 0;
  for (const size_t i : group) {
    num_rows += views[i].offset.size();
    stacked.num_rows_without_correction += views[i].num_rows_without_correction;
    stacked.residual_sum_of_squares += views[i].residual_sum_of_squares;
    stacked.num_residual_dof += views[i].num_residual_dof;
  }
  stacked.by_unknowns.resize(num_rows, views[group.front()].by_unknowns.cols());
  stacked.by_correction.resize(num_rows, 6);
  stacked.offset.resize(num_rows);
  // Rows that depend on the correction come before those that do not.
  Eigen::Index correction_dependent = 0;
  Eigen::Index unmoved = num_rows - stacked.num_rows_without_correction;
  for (const size_t i : group) {
    const LinearisedView& view = views[i];
    const Eigen::Index num_rows_with_correction = view.offset.size() - view.num_rows_without_correction;
    stacked.by_unknowns.middleRows(correction_dependent, num_rows_with_correction) =
        view.by_unknowns.topRows(num_rows_with_correction);
    stacked.by_correction.middleRows(correction_dependent, num_rows_with_correction) =
        view.by_correction.topRows(num_rows_with_correction);
    stacked.offset.segment(correction_dependent, num_rows_with_correction) = view.offset.head(num_rows_with_correction);
    stacked.by_unknowns.middleRows(unmoved, view.num_rows_without_correction) =
        view.by_unknowns.bottomRows(view.num_rows_without_correction);
    stacked.by_correction.middleRows(unmoved, view.num_rows_without_correction) =
        view.by_correction.bottomRows(view.num_rows_without_correction);
    stacked.offset.segment(unmoved, view.num_rows_without_correction) =
        view.offset.tail(view.num_rows_without_correction);
    correction_dependent += num_rows_with_correction;
    unmoved += view.num_rows_without_correction;
  }
  return Condensed(stacked);
}

}  // namespace

PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views) {
  std::vector<Rigid3d> poses;
  for (const View& view : views) poses.push_back(BaseFromGripper(setup, view.camera_mount_from_target_mount));
  // Sorted by x: only poses that are close in this order can be the same.
  std::vector<size_t> order(views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const double x_a = poses[a].translation.x();
    const double x_b = poses[b].translation.x();
    return x_a != x_b ? x_a < x_b : a < b;
  });
  std::vector<size_t> place(views.size());
  for (size_t k = 0; k < order.size(); ++k) place[order[k]] = k;
  constexpr size_t kNone = static_cast<size_t>(-1);
  std::vector<size_t> group_of(views.size(), kNone);
  PoseGroups groups;
  for (size_t i = 0; i < views.size(); ++i) {
    if (group_of[i] != kNone) continue;
    std::vector<size_t> group;
    const auto visit = [&](size_t k) {
      const size_t j = order[k];
      if (std::abs(poses[j].translation.x() - poses[i].translation.x()) > kSamePoseM) return false;
      const bool is_same = group_of[j] == kNone && DistanceM(poses[i], poses[j]) <= kSamePoseM &&
                           AngleRad(poses[i], poses[j]) <= kSamePoseRad;
      if (is_same) {
        group_of[j] = groups.size();
        group.push_back(j);
      }
      return true;
    };
    for (size_t k = place[i]; k < order.size() && visit(k); ++k) {
    }
    for (size_t k = place[i]; k > 0 && visit(k - 1); --k) {
    }
    std::sort(group.begin(), group.end());
    groups.push_back(std::move(group));
  }
  return groups;
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
