#include "solvers/calibration/capture_outliers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/median.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/inliers.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr size_t kMinCaptures = 6;

// Variance of a robot that is exact except for rounding, m^2 and rad^2.
constexpr double kExact2 = 1e-18;

// The variances with which captures are tested.
struct Variances {
  double pixel = 1;  // In the views' unit.
  double translation_m2 = kExact2;
  double rotation_rad2 = kExact2;

  Tangent6 Corrections() const { return CorrectionVariances({std::sqrt(translation_m2), std::sqrt(rotation_rad2)}); }
};

// Estimates the variances from these captures.
Variances EstimateFrom(const std::vector<LinearisedView>& views, const Variances& start) {
  std::vector<VarianceGroup> groups = CorrectionGroups(start.pixel, {}, true, true);
  groups[kTranslationGroup].variance = start.translation_m2;
  groups[kRotationGroup].variance = start.rotation_rad2;
  const Eigen::VectorXd found = EstimateVariances(views, groups, kRoughVariances).variances;
  return {found[kPixelGroup], found[kTranslationGroup], found[kRotationGroup]};
}

// Returns the points by which a view is tested: its inliers, or all points if most of them were rejected.
Observations JudgedPoints(const Observations& observations, const std::vector<int>& rejected_ids) {
  if (2 * rejected_ids.size() > observations.ids.size()) return observations;
  return WithoutPoints(observations, rejected_ids);
}

// Estimates a view's correction as if the pixel noise were the only noise, with a weak prior on what is physically
// possible.
Tangent6 RoughCorrection(const LinearisedView& view) {
  constexpr double kPossibleM = 0.05;
  constexpr double kPossibleRad = 0.1;
  Matrix6 normal = view.by_effects.transpose() * view.by_effects;
  normal.diagonal().head<3>().array() += 1 / (kPossibleM * kPossibleM);
  normal.diagonal().tail<3>().array() += 1 / (kPossibleRad * kPossibleRad);
  return SolveSymmetric(normal, view.by_effects.transpose() * view.offset);
}

// The half of the captures with the smallest corrections, and the variances of the robot from the median corrections.
struct BestHalf {
  std::vector<bool> is_member;  // One flag for each capture.
  Variances variances;
};
BestHalf FindBestHalf(const std::vector<LinearisedView>& views) {
  Variances start;
  const double median_of_3_dof = ChiSquareQuantile(0.5, 3);
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const LinearisedView& view : views) {
    const Tangent6 correction = RoughCorrection(view);
    translations.push_back(correction.head<3>().squaredNorm());
    rotations.push_back(correction.tail<3>().squaredNorm());
  }
  start.translation_m2 = std::max(kExact2, Median(translations) / median_of_3_dof);
  start.rotation_rad2 = std::max(kExact2, Median(rotations) / median_of_3_dof);
  std::vector<size_t> order(views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto size_of = [&](size_t i) {
    return translations[i] / start.translation_m2 + rotations[i] / start.rotation_rad2;
  };
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return size_of(a) < size_of(b); });
  std::vector<bool> is_member(views.size(), false);
  for (size_t k = 0; k < (views.size() + 1) / 2; ++k) is_member[order[k]] = true;
  return {std::move(is_member), start};
}

// Returns the mean of a chi-square variable with 6 degrees of freedom that is truncated at its median, divided by 6.
double ShareOfBestHalf() {
  // E[x; x < m] = 6 P(chi2_8 < m), over P(x < m) = 1/2.
  const double median = ChiSquareQuantile(0.5, 6);
  return 2 * (1 - ChiSquareTail(median, 8));
}

// Returns the normal equations of a view: their matrix and, in the last column, their right-hand side.
Eigen::MatrixXd NormalOf(const LinearisedView& view, const Variances& variances) {
  const Eigen::Index n = view.by_unknowns.cols();
  const RowMajorMatrix whitened = WhitenedRows(view, variances.pixel, variances.Corrections());
  return whitened.leftCols(n).transpose().lazyProduct(whitened);
}

// Returns the variance of the rows that depend on the correction, in the views' unit, including the errors that no
// model describes: a smooth field of kUnmodelledPx at each of the 2 N coordinates, distributed over the six
// parameters of a pose.
double VarianceWithUnmodelled(const LinearisedView& view, double pixel_variance, double pixel_sigma_px) {
  const double num_coordinates = static_cast<double>(view.offset.size() + view.num_residual_dof);
  const double ratio = kUnmodelledPx / pixel_sigma_px;
  return pixel_variance + num_coordinates / 6 * ratio * ratio;
}

// Returns the tail probability of a view's correction, given the prediction from the normal equations of the others.
double PValue(const LinearisedView& view, const Eigen::MatrixXd& others, const Variances& variances,
              double pixel_sigma_px, double dof) {
  // Y, with Y^T Y the covariance of the prediction, and in the last column the vector that Y^T maps to the
  // prediction.
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index rows = view.offset.size();
  const Eigen::VectorXd scale = others.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const auto root = Cholesky(scale.asDiagonal() * others.leftCols(n) * scale.asDiagonal());
  // Captures that do not determine the unknowns predict nothing.
  if (!root) return 1;
  RowMajorMatrix predicted(n, rows + 1);
  predicted << view.by_unknowns.transpose(), others.col(n);
  predicted = (scale.asDiagonal() * predicted).eval();
  SolveLowerInPlace(root->lower(), &predicted);
  const auto y = predicted.leftCols(rows);
  Eigen::MatrixXd covariance = y.transpose().lazyProduct(y);
  const Eigen::Index num_dependent = rows - view.num_rows_without_effects;
  covariance.diagonal().array() += variances.pixel;
  covariance.diagonal().head(num_dependent).array() +=
      VarianceWithUnmodelled(view, variances.pixel, pixel_sigma_px) - variances.pixel;
  const auto b = Cholesky(covariance);
  if (!b) return 1;
  // g = G^T B^-1 e has the covariance M + M Q M, M = G^T B^-1 G. It is scaled because it mixes metres and radians.
  RowMajorMatrix whitened(rows, 7);
  whitened << view.by_effects, view.offset - y.transpose() * predicted.col(rows);
  SolveLowerInPlace(b->lower(), &whitened);
  const auto by_correction = whitened.leftCols<6>();
  const Matrix6 m = by_correction.transpose().lazyProduct(by_correction);
  const Tangent6 g = by_correction.transpose() * whitened.col(6);
  const Matrix6 total = m + m * variances.Corrections().asDiagonal() * m;
  const Tangent6 unit = total.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
  constexpr double kNothing = 1e-10;
  return PValueOf(unit.cwiseProduct(g), unit.asDiagonal() * total * unit.asDiagonal(), kNothing, dof);
}

// The captures that can be tested, linearised at a solution.
struct JudgedViews {
  std::vector<LinearisedView> views;
  std::vector<size_t> index;   // The capture of each of them.
  PoseGroups groups;           // The tested views, grouped by robot pose.
  std::vector<size_t> hidden;  // Captures with a point that cannot be projected.
  double pixel_sigma_px = 1;
};

// The captures with the errors of the robot that the solution has found, which count as known.
JudgedViews ViewsToJudge(const Problem& problem, const Solution& solution) {
  JudgedViews judged;
  judged.pixel_sigma_px = solution.pixel_sigmas_px[0];
  Problem visible = WithoutNoisyJoints(problem);
  visible.effects.clear();
  for (const size_t i : CapturesWithPoints(problem)) {
    ProblemCapture& capture = visible.captures[i];
    CHECK_EQ(capture.images.size(), 1U);
    capture.base_from_gripper = WithErrors(capture, solution.effects);
    capture.effects.clear();
    Observations& points = capture.images[0].observations;
    points = JudgedPoints(points, solution.captures[i].rejected_ids[0]);
    const Rigid3d camera_from_target = CameraFromTarget(visible, solution.poses, 0, 0, capture.base_from_gripper);
    if (!Residuals(solution.cameras[0], camera_from_target, ApplyShape(points, solution.shapes[0]))) {
      judged.hidden.push_back(i);
      points = Observations();
    }
  }
  judged.index = CapturesWithPoints(visible);
  if (judged.index.empty()) return judged;
  const FitState state{solution.poses, solution.cameras, solution.shapes, {}, {}};
  visible = WeightedAs(solution, std::move(visible));
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(visible, state, NoiseOf(solution), LossOf(LossKind::kNone));
  if (!views) return judged;
  judged.views = std::move(*views);
  std::vector<size_t> place(problem.captures.size());
  for (size_t v = 0; v < judged.index.size(); ++v) place[judged.index[v]] = v;
  for (const std::vector<size_t>& group : GroupByRobotPoses(visible)) {
    std::vector<size_t>& of_views = judged.groups.emplace_back();
    for (const size_t i : group) of_views.push_back(place[i]);
  }
  return judged;
}

// The members only, one stacked view per robot pose.
struct Members {
  std::vector<LinearisedView> views;
  std::vector<size_t> group_of;  // Index of each of `views` in JudgedViews::groups.
};

Members MembersOf(const JudgedViews& judged, const std::vector<bool>& is_member) {
  Members members;
  for (size_t g = 0; g < judged.groups.size(); ++g) {
    std::vector<size_t> group;
    for (const size_t i : judged.groups[g]) {
      if (is_member[i]) group.push_back(i);
    }
    if (group.empty()) continue;
    std::vector<LinearisedView> views;
    for (const size_t i : group) views.push_back(judged.views[i]);
    std::vector<size_t> all(views.size());
    std::iota(all.begin(), all.end(), size_t{0});
    members.views.push_back(StackGroups(views, {all}).front());
    members.group_of.push_back(g);
  }
  return members;
}

// Returns the tail probability of each tested view, given the estimate from the members at other robot poses.
std::vector<double> PValues(const JudgedViews& judged, const Members& members, const Variances& variances, double dof) {
  const Eigen::Index num_unknowns = judged.views.front().by_unknowns.cols();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(num_unknowns, num_unknowns + 1);
  std::vector<Eigen::MatrixXd> normal_of_group(judged.groups.size());
  for (size_t k = 0; k < members.views.size(); ++k) {
    Eigen::MatrixXd& normal = normal_of_group[members.group_of[k]];
    normal = NormalOf(members.views[k], variances);
    all += normal;
  }
  std::vector<double> p_values(judged.views.size(), 1.0);
  for (size_t g = 0; g < judged.groups.size(); ++g) {
    const Eigen::MatrixXd& own = normal_of_group[g];
    for (const size_t i : judged.groups[g]) {
      p_values[i] = own.size() > 0 ? PValue(judged.views[i], all - own, variances, judged.pixel_sigma_px, dof)
                                   : PValue(judged.views[i], all, variances, judged.pixel_sigma_px, dof);
    }
  }
  return p_values;
}

double DofOf(const Members& members) {
  return 6.0 * static_cast<double>(members.views.size()) -
         static_cast<double>(members.views.front().by_unknowns.cols());
}

// Fewer degrees of freedom do not determine the noise.
constexpr double kLeastDof = 6;

}  // namespace

ImageSet WrongOf(const std::vector<CaptureVerdict>& verdicts) {
  ImageSet wrong;
  for (size_t i = 0; i < verdicts.size(); ++i) {
    if (verdicts[i].is_wrong) wrong.insert({i, 0});
  }
  return wrong;
}

Problem WithoutNoisyJoints(Problem problem) {
  for (ProblemCapture& capture : problem.captures) {
    for (ArmPosture& posture : capture.postures) posture.gripper_by_joints.resize(6, 0);
  }
  return problem;
}

std::vector<CaptureVerdict> FindOutlierCaptures(const Problem& problem, const Solution& solution) {
  const std::vector<CaptureVerdict> all_pass(problem.captures.size());
  std::vector<CaptureVerdict> verdicts = all_pass;
  const JudgedViews judged = ViewsToJudge(problem, solution);
  const bool can_tell = judged.views.size() + judged.hidden.size() >= kMinCaptures;
  for (const size_t i : judged.hidden) verdicts[i] = {can_tell, 0};
  if (judged.views.size() < kMinCaptures) return verdicts;
  const BestHalf best_half = FindBestHalf(judged.views);
  std::vector<bool> is_member = best_half.is_member;
  Variances variances = best_half.variances;
  const double limit = kCaptureFalseAlarm / static_cast<double>(judged.views.size());
  std::vector<double> p_values;
  constexpr int kMaxRounds = 20;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Members members = MembersOf(judged, is_member);
    const double dof = members.views.empty() ? 0 : DofOf(members);
    if (dof < kLeastDof) return all_pass;
    variances = EstimateFrom(members.views, variances);
    Variances used = variances;
    if (round == 0) {
      used.translation_m2 /= ShareOfBestHalf();
      used.rotation_rad2 /= ShareOfBestHalf();
    }
    p_values = PValues(judged, members, used, dof);
    std::vector<bool> passes;
    for (const double p_value : p_values) passes.push_back(p_value >= limit);
    if (passes == is_member) break;
    is_member = std::move(passes);
  }
  for (size_t v = 0; v < judged.views.size(); ++v) verdicts[judged.index[v]] = {!is_member[v], p_values[v]};
  return verdicts;
}

std::vector<CaptureVerdict> TestLeftOutCaptures(const Problem& problem, const Solution& solution,
                                                const std::vector<size_t>& left_out) {
  Solution at = solution;
  for (const size_t i : left_out) at.captures[i].rejected_ids = {{}};
  const JudgedViews judged = ViewsToJudge(problem, at);
  std::vector<CaptureVerdict> of_all(problem.captures.size());
  const auto verdicts = [&] {
    std::vector<CaptureVerdict> of_left_out;
    for (const size_t i : left_out) of_left_out.push_back(of_all[i]);
    return of_left_out;
  };
  for (const size_t i : judged.hidden) of_all[i] = {true, 0};
  const std::set<size_t> others(left_out.begin(), left_out.end());
  std::vector<bool> is_member;
  for (const size_t i : judged.index) is_member.push_back(!others.contains(i));
  const Members members = MembersOf(judged, is_member);
  const double dof = members.views.empty() ? 0 : DofOf(members);
  if (dof < kLeastDof) return verdicts();
  Variances variances = EstimateFrom(members.views, {});
  if (const std::optional<RobotNoise> smooth = SmoothNoiseOf(solution, 0)) {
    // The members say little about smooth errors at other poses: the test counts them as unknown.
    variances.translation_m2 += std::pow(smooth->translation_m, 2);
    variances.rotation_rad2 += std::pow(smooth->rotation_rad, 2);
  }
  const std::vector<double> p_values = PValues(judged, members, variances, dof);
  const double limit = kCaptureFalseAlarm / static_cast<double>(CapturesWithPoints(problem).size());
  for (size_t v = 0; v < judged.views.size(); ++v) of_all[judged.index[v]] = {p_values[v] < limit, p_values[v]};
  return verdicts();
}

}  // namespace heba
