#include "solvers/capture_test.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/small_matrix.h"
#include "heba/evaluation/metrics.h"
#include "solvers/inliers.h"
#include "solvers/noise_scale.h"
#include "solvers/robot_noise.h"
#include "solvers/variance_components.h"

namespace heba {
namespace {

constexpr size_t kMinCaptures = 6;

// The points by which a view is judged: those that agree with the estimate; all, if most do not.
Observations JudgedPoints(const Observations& observations, const std::vector<int>& rejected_ids) {
  if (2 * rejected_ids.size() > observations.ids.size()) return observations;
  std::vector<bool> keep;
  for (const int id : observations.ids) {
    keep.push_back(std::find(rejected_ids.begin(), rejected_ids.end(), id) == rejected_ids.end());
  }
  return KeepPoints(observations, keep);
}

// What each capture's correction would be if nothing but pixels were noisy, held to what is possible at all.
Tangent6 RoughCorrection(const LinearView& view) {
  constexpr double kPossibleM = 0.05;
  constexpr double kPossibleRad = 0.1;
  Matrix6 normal = view.by_correction.transpose() * view.by_correction;
  normal.diagonal().head<3>().array() += 1 / (kPossibleM * kPossibleM);
  normal.diagonal().tail<3>().array() += 1 / (kPossibleRad * kPossibleRad);
  return normal.ldlt().solve(view.by_correction.transpose() * view.offset);
}

// The half of the captures with the smallest corrections, and the variances that these have.
std::vector<bool> BestHalf(const std::vector<LinearView>& views, VarianceComponents* start) {
  const double median_of_3_dof = ChiSquareQuantile(0.5, 3);
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const LinearView& view : views) {
    const Tangent6 correction = RoughCorrection(view);
    translations.push_back(correction.head<3>().squaredNorm());
    rotations.push_back(correction.tail<3>().squaredNorm());
  }
  constexpr double kExact2 = 1e-18;
  start->translation_m2 = std::max(kExact2, Median(translations) / median_of_3_dof);
  start->rotation_rad2 = std::max(kExact2, Median(rotations) / median_of_3_dof);
  std::vector<size_t> order(views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto size_of = [&](size_t i) {
    return translations[i] / start->translation_m2 + rotations[i] / start->rotation_rad2;
  };
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return size_of(a) < size_of(b); });
  std::vector<bool> is_member(views.size(), false);
  for (size_t k = 0; k < (views.size() + 1) / 2; ++k) is_member[order[k]] = true;
  return is_member;
}

// Of the 6 degrees of freedom of a chi-square only those below the median: their mean, over 6.
double ShareOfBestHalf() {
  // E[x; x < m] = 6 P(chi2_8 < m), over P(x < m) = 1/2.
  const double median = ChiSquareQuantile(0.5, 6);
  return 2 * (1 - ChiSquareTail(median, 8));
}

// The normal equations of a view: their matrix and, in the last column, their right side.
Eigen::MatrixXd NormalOf(const LinearView& view, const VarianceComponents& variances) {
  const Eigen::Index n = view.by_unknowns.cols();
  const RowMajorMatrix whitened =
      WhitenedRows(view, variances.pixel, variances.translation_m2, variances.rotation_rad2);
  return whitened.leftCols(n).transpose().lazyProduct(whitened);
}

// The tail probability of what a view's correction is off by, predicted by the normal equations of others.
double PValue(const LinearView& view, const Eigen::MatrixXd& others, const VarianceComponents& variances, double dof) {
  // The prediction's root: Y with Y^T Y its covariance, and what it predicts.
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index rows = view.offset.size();
  const Eigen::VectorXd scale = others.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::LLT<Eigen::MatrixXd> root(scale.asDiagonal() * others.leftCols(n) * scale.asDiagonal());
  // Others that do not determine the unknowns predict nothing.
  if (root.info() != Eigen::Success) return 1;
  RowMajorMatrix predicted(n, rows + 1);
  predicted << view.by_unknowns.transpose(), others.col(n);
  predicted = (scale.asDiagonal() * predicted).eval();
  SolveLowerInPlace(root.matrixLLT(), &predicted);
  const auto y = predicted.leftCols(rows);
  Eigen::MatrixXd covariance = y.transpose().lazyProduct(y);
  covariance.diagonal().array() += variances.pixel;
  const Eigen::LLT<Eigen::MatrixXd> b(covariance);
  if (b.info() != Eigen::Success) return 1;
  // g = G^T B^-1 e has covariance M + M Q M, M = G^T B^-1 G. Metres and radians side by side: scaled.
  RowMajorMatrix whitened(rows, 7);
  whitened << view.by_correction, view.offset - y.transpose() * predicted.col(rows);
  SolveLowerInPlace(b.matrixLLT(), &whitened);
  const auto by_correction = whitened.leftCols<6>();
  const Matrix6 m = by_correction.transpose().lazyProduct(by_correction);
  const Tangent6 g = by_correction.transpose() * whitened.col(6);
  Tangent6 q;
  q << Eigen::Vector3d::Constant(variances.translation_m2), Eigen::Vector3d::Constant(variances.rotation_rad2);
  const Matrix6 total = m + m * q.asDiagonal() * m;
  const Tangent6 unit = total.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
  constexpr double kNothing = 1e-10;
  return ChanceOf(unit.cwiseProduct(g), unit.asDiagonal() * total * unit.asDiagonal(), kNothing, dof);
}

}  // namespace

std::vector<CaptureVerdict> TestCaptures(const Problem& problem, const Solution& solution, const FreeParameters& free) {
  std::vector<CaptureVerdict> verdicts(problem.views.size());
  Problem judged{solution.camera, {}, problem.setup, solution.shape};
  std::vector<size_t> index;
  for (size_t i = 0; i < problem.views.size(); ++i) {
    View view = problem.views[i];
    view.observations = JudgedPoints(view.observations, solution.rejected_ids[i]);
    const Rigid3d camera_from_target = CameraFromTarget(solution.hand_eye, view.camera_mount_from_target_mount);
    if (!Residuals(solution.camera, camera_from_target, Shaped(view.observations, solution.shape))) {
      verdicts[i] = {problem.views.size() >= kMinCaptures, 0};
      continue;
    }
    judged.views.push_back(std::move(view));
    index.push_back(i);
  }
  if (judged.views.size() < kMinCaptures) return verdicts;
  const std::optional<std::vector<LinearView>> views = LineariseViewsAt(judged, solution, {}, free, *FindLoss("none"));
  CHECK(views.has_value());
  const Eigen::Index num_unknowns = views->front().by_unknowns.cols();

  VarianceComponents variances;
  std::vector<bool> is_member = BestHalf(*views, &variances);
  const double limit = kCaptureFalseAlarm / static_cast<double>(views->size());
  std::vector<double> p_values(views->size(), 1.0);
  constexpr int kMaxRounds = 20;
  for (int round = 0; round < kMaxRounds; ++round) {
    std::vector<LinearView> members;
    for (size_t i = 0; i < views->size(); ++i) {
      if (is_member[i]) members.push_back((*views)[i]);
    }
    const double dof = 6.0 * static_cast<double>(members.size()) - static_cast<double>(num_unknowns);
    if (dof < 6) return std::vector<CaptureVerdict>(problem.views.size());
    variances = EstimateVariances(members, variances, true, true, kRoughVariances);
    VarianceComponents used = variances;
    if (round == 0) {
      used.translation_m2 /= ShareOfBestHalf();
      used.rotation_rad2 /= ShareOfBestHalf();
    }
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(num_unknowns, num_unknowns + 1);
    std::vector<Eigen::MatrixXd> normals;
    for (size_t i = 0; i < views->size(); ++i) {
      normals.push_back(NormalOf((*views)[i], used));
      if (is_member[i]) all += normals.back();
    }
    std::vector<bool> passes(views->size());
    for (size_t i = 0; i < views->size(); ++i) {
      p_values[i] = PValue((*views)[i], is_member[i] ? all - normals[i] : all, used, dof);
      passes[i] = p_values[i] >= limit;
    }
    if (passes == is_member) break;
    is_member = std::move(passes);
  }
  for (size_t i = 0; i < views->size(); ++i) verdicts[index[i]] = {!is_member[i], p_values[i]};
  return verdicts;
}

}  // namespace heba
