#include "solvers/robot_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "solvers/noise_scale.h"
#include "solvers/view_reduction.h"

namespace heba {

Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction) {
  const Rigid3d corrected = setup == Setup::kEyeToHand ? camera_mount_from_target_mount * correction
                                                       : Inverse(correction) * camera_mount_from_target_mount;
  return CameraFromTarget(hand_eye, corrected);
}

Matrix6 LeftFromCorrection(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                           const Rigid3d& correction) {
  const Rigid3d camera_from_camera_mount = Inverse(hand_eye.camera_mount_from_camera);
  if (setup == Setup::kEyeInHand) return -Adjoint(camera_from_camera_mount);
  return Adjoint(camera_from_camera_mount * camera_mount_from_target_mount * correction);
}

CorrectionPrior CorrectionPriorAt(const Rigid3d& correction, const RobotNoise& noise) {
  CorrectionPrior prior;
  const Tangent6 tangent = LocalCoordinates(Rigid3d(), correction);
  prior.residual.head<3>() = tangent.head<3>() / noise.translation_m;
  prior.residual.tail<3>() = tangent.tail<3>() / noise.rotation_rad;
  prior.by_tangent.topLeftCorner<3, 3>() = correction.RotationMatrix() / noise.translation_m;
  // The inverse right Jacobian of the rotation vector, to second order: corrections are small.
  const Eigen::Matrix3d skew = Skew(tangent.tail<3>());
  prior.by_tangent.bottomRightCorner<3, 3>() =
      (Eigen::Matrix3d::Identity() + 0.5 * skew + skew * skew / 12) / noise.rotation_rad;
  return prior;
}

std::optional<std::vector<LinearView>> LineariseViews(const Problem& problem, const HandEye& hand_eye,
                                                      const std::vector<Rigid3d>& corrections,
                                                      const FreeParameters& free, double pixel_sigma_px,
                                                      const Loss& loss) {
  const CameraModel& model = problem.camera.Model();
  std::vector<Eigen::Index> free_columns;
  for (size_t i = 0; i < free.size(); ++i) {
    if (free[i]) free_columns.push_back(6 + static_cast<Eigen::Index>(i));
  }
  const Eigen::Index num_unknowns = 12 + static_cast<Eigen::Index>(free_columns.size());
  std::vector<LinearView> result;
  for (size_t v = 0; v < problem.views.size(); ++v) {
    const View& view = problem.views[v];
    const Rigid3d correction = corrections.empty() ? Rigid3d() : corrections[v];
    const Rigid3d& mount = view.camera_mount_from_target_mount;
    const Rigid3d camera_from_target = CameraFromTarget(problem.setup, hand_eye, mount, correction);
    ViewReduction reduction;
    if (!ReduceView(model, problem.camera.params.data(), camera_from_target, view.observations, pixel_sigma_px, loss,
                    &reduction, HasShape(free, model) ? &problem.shape : nullptr)) {
      return std::nullopt;
    }
    LinearView linear;
    const Eigen::Index columns = reduction.factor.cols() - 1;
    Eigen::Index rows = reduction.factor.rows();
    if (2 * view.observations.size() > rows) {
      // A triangular factor: its last row has nothing but what the unknowns do not reach.
      rows = columns;
      linear.rest_squares = reduction.factor(columns, columns) * reduction.factor(columns, columns);
      linear.num_rest = 2 * view.observations.size() - static_cast<int>(columns);
    }
    const Eigen::MatrixXd by_pose = reduction.factor.topLeftCorner(rows, 6);
    linear.by_unknowns.resize(rows, num_unknowns);
    linear.by_unknowns.leftCols<6>() = by_pose;  // The hand-eye pose's is -by_pose: both signs are minus the row's.
    linear.by_unknowns.middleCols<6>(6) = -by_pose * Adjoint(camera_from_target);
    for (size_t i = 0; i < free_columns.size(); ++i) {
      linear.by_unknowns.col(12 + static_cast<Eigen::Index>(i)) = -reduction.factor.col(free_columns[i]).head(rows);
    }
    linear.by_correction = -by_pose * LeftFromCorrection(problem.setup, hand_eye, mount, correction);
    // The residual as it would be without the correction.
    linear.offset =
        reduction.factor.col(columns).head(rows) + linear.by_correction * LocalCoordinates(Rigid3d(), correction);
    result.push_back(std::move(linear));
  }
  return result;
}

std::optional<std::vector<LinearView>> LineariseViewsAt(const Problem& problem, const Solution& solution,
                                                        const std::vector<Rigid3d>& corrections,
                                                        const FreeParameters& free, const Loss& loss) {
  Problem weighted{solution.camera, problem.views, problem.setup, solution.shape};
  if (solution.excess_px) WeightByCovariance(*solution.excess_px, &weighted.views);
  return LineariseViews(weighted, solution.hand_eye, corrections, free, solution.pixel_sigma_px, loss);
}

Eigen::MatrixXd MarginalCovariance(const LinearView& view, double pixel_variance, double translation_m2,
                                   double rotation_rad2) {
  const Eigen::Index rows = view.offset.size();
  const auto translation = view.by_correction.leftCols<3>();
  const auto rotation = view.by_correction.rightCols<3>();
  return pixel_variance * Eigen::MatrixXd::Identity(rows, rows) +
         translation_m2 * translation * translation.transpose() + rotation_rad2 * rotation * rotation.transpose();
}

namespace {

// The same measurements in fewer rows: of each view those that its correction moves, at most six, and one more view
// with what no correction moves in any of them. Variances and unknowns have the same likelihood.
std::vector<LinearView> Condensed(const std::vector<LinearView>& views) {
  constexpr Eigen::Index kMoved = 6;
  const Eigen::Index n = views.front().by_unknowns.cols();
  std::vector<LinearView> condensed;
  LinearView still;
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(n + 1, n + 1);  // Of the still rows: unknowns, offset.
  for (const LinearView& view : views) {
    const Eigen::Index rows = view.offset.size();
    still.rest_squares += view.rest_squares;
    still.num_rest += view.num_rest;
    const Eigen::Index moved = std::min(rows, kMoved);
    Eigen::MatrixXd turned(rows, n + 1);
    turned << view.by_unknowns, view.offset;
    LinearView kept;
    kept.by_correction = view.by_correction;
    if (rows > kMoved) {
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(view.by_correction);
      turned.applyOnTheLeft(qr.householderQ().adjoint());
      kept.by_correction = qr.matrixQR().topRows<kMoved>().triangularView<Eigen::Upper>();
      const auto tail = turned.bottomRows(rows - kMoved);
      products.noalias() += tail.transpose() * tail;
      still.num_rest += static_cast<int>(rows - kMoved);
    }
    kept.by_unknowns = turned.topLeftCorner(moved, n);
    kept.offset = turned.col(n).head(moved);
    condensed.push_back(std::move(kept));
  }
  const Eigen::MatrixXd root = RootOfProducts(products);
  still.by_unknowns = root.topLeftCorner(n, n);
  still.offset = root.col(n).head(n);
  still.by_correction = Eigen::MatrixXd::Zero(n, kMoved);
  still.rest_squares += root(n, n) * root(n, n);
  still.num_rest -= static_cast<int>(n);
  condensed.push_back(std::move(still));
  return condensed;
}

// The restricted likelihood and its derivatives by the three variances.
struct Likelihood {
  double minus_log = std::numeric_limits<double>::infinity();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // Of the log.
  Eigen::Matrix3d fisher = Eigen::Matrix3d::Zero();
};

Likelihood Evaluate(const std::vector<LinearView>& views, const Eigen::Vector3d& variances) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  Likelihood result;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::MatrixXd> inverses;
  double log_determinants = 0;
  for (const LinearView& view : views) {
    const Eigen::LLT<Eigen::MatrixXd> factor(MarginalCovariance(view, variances[0], variances[1], variances[2]));
    if (factor.info() != Eigen::Success) return result;
    inverses.emplace_back(factor.solve(Eigen::MatrixXd::Identity(view.offset.size(), view.offset.size())));
    log_determinants += 2 * factor.matrixLLT().diagonal().array().log().sum() + view.num_rest * std::log(variances[0]);
    information += view.by_unknowns.transpose() * inverses.back() * view.by_unknowns;
    right += view.by_unknowns.transpose() * inverses.back() * view.offset;
  }
  // Units of metres, radians and pixels side by side: scaled before it is factored.
  const Eigen::VectorXd scale =
      information.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * information * scale.asDiagonal());
  if (factor.info() != Eigen::Success) return result;
  log_determinants += 2 * factor.matrixLLT().diagonal().array().log().sum() - 2 * scale.array().log().sum();
  const Eigen::MatrixXd covariance =
      scale.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(n, n)) * scale.asDiagonal();
  const Eigen::VectorXd step = covariance * right;

  double squares = 0;
  std::array<Eigen::MatrixXd, 3> seen;  // Sum of J^T S^-1 V_k S^-1 J.
  for (Eigen::MatrixXd& matrix : seen) matrix = Eigen::MatrixXd::Zero(n, n);
  for (size_t v = 0; v < views.size(); ++v) {
    const LinearView& view = views[v];
    const Eigen::MatrixXd& inverse = inverses[v];
    const Eigen::Index rows = view.offset.size();
    const Eigen::VectorXd residual = view.offset - view.by_unknowns * step;
    const Eigen::VectorXd weighted = inverse * residual;
    squares += residual.dot(weighted) + view.rest_squares / variances[0];
    const std::array<Eigen::MatrixXd, 3> roots = {Eigen::MatrixXd::Identity(rows, rows),
                                                  view.by_correction.leftCols<3>(), view.by_correction.rightCols<3>()};
    std::array<Eigen::MatrixXd, 3> inverse_v;  // S^-1 V_k
    const Eigen::MatrixXd weighted_by = inverse * view.by_unknowns;
    for (int k = 0; k < 3; ++k) {
      const Eigen::MatrixXd v_k = roots[static_cast<size_t>(k)] * roots[static_cast<size_t>(k)].transpose();
      inverse_v[static_cast<size_t>(k)] = inverse * v_k;
      const Eigen::MatrixXd b = weighted_by.transpose() * v_k * weighted_by;
      seen[static_cast<size_t>(k)] += b;
      result.gradient[k] -= 0.5 * (inverse_v[static_cast<size_t>(k)].trace() - covariance.cwiseProduct(b).sum());
      result.gradient[k] += 0.5 * weighted.dot(v_k * weighted);
    }
    result.gradient[0] += 0.5 * (view.rest_squares / (variances[0] * variances[0]) - view.num_rest / variances[0]);
    result.fisher(0, 0) += 0.5 * view.num_rest / (variances[0] * variances[0]);
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l <= k; ++l) {
        const Eigen::MatrixXd product = inverse_v[static_cast<size_t>(k)] * inverse_v[static_cast<size_t>(l)];
        const double through = (view.by_unknowns.transpose() * product * weighted_by).cwiseProduct(covariance).sum();
        result.fisher(k, l) += 0.5 * product.trace() - through;
      }
    }
  }
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l <= k; ++l) {
      result.fisher(k, l) +=
          0.5 *
          (covariance * seen[static_cast<size_t>(k)] * covariance).cwiseProduct(seen[static_cast<size_t>(l)]).sum();
      result.fisher(l, k) = result.fisher(k, l);
    }
  }
  result.minus_log = 0.5 * (log_determinants + squares);
  return result;
}

}  // namespace

double ChanceOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(covariance);
  const Tangent6 along = eigen.eigenvectors().transpose() * vector;
  double statistic = 0;
  int rank = 0;
  for (int i = 0; i < 6; ++i) {
    if (eigen.eigenvalues()[i] < nothing) continue;
    statistic += along[i] * along[i] / eigen.eigenvalues()[i];
    ++rank;
  }
  return rank == 0 ? 1 : FisherTail(statistic / rank, rank, dof);
}

Eigen::MatrixXd MarginalInformation(const std::vector<LinearView>& views, const RobotNoise& noise,
                                    double pixel_variance) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  for (const LinearView& view : views) {
    const Eigen::LLT<Eigen::MatrixXd> factor(MarginalCovariance(
        view, pixel_variance, noise.translation_m * noise.translation_m, noise.rotation_rad * noise.rotation_rad));
    CHECK(factor.info() == Eigen::Success);
    information += view.by_unknowns.transpose() * factor.solve(view.by_unknowns);
  }
  return information;
}

VarianceComponents EstimateVariances(const std::vector<LinearView>& all_views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free) {
  CHECK(!all_views.empty());
  const std::vector<LinearView> views = Condensed(all_views);
  Eigen::Vector3d variances(start.pixel, start.translation_m2, start.rotation_rad2);
  const std::array<bool, 3> may_move = {pixel_is_free, robot_is_free, robot_is_free};
  Likelihood here = Evaluate(views, variances);
  constexpr int kMaxIterations = 100;
  constexpr double kMinPixelVariance = 1e-12;
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(here.minus_log); ++iteration) {
    // A variance at zero that wants to be less stays.
    std::vector<int> free;
    for (int k = 0; k < 3; ++k) {
      if (may_move[static_cast<size_t>(k)] && (variances[k] > 0 || here.gradient[k] > 0)) free.push_back(k);
    }
    if (free.empty()) break;
    const Eigen::Index size = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd fisher(size, size);
    Eigen::VectorXd gradient(size);
    for (Eigen::Index a = 0; a < size; ++a) {
      gradient[a] = here.gradient[free[static_cast<size_t>(a)]];
      for (Eigen::Index b = 0; b < size; ++b) {
        fisher(a, b) = here.fisher(free[static_cast<size_t>(a)], free[static_cast<size_t>(b)]);
      }
    }
    const Eigen::VectorXd scale = fisher.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
    const Eigen::MatrixXd scaled = scale.asDiagonal() * fisher * scale.asDiagonal();
    const Eigen::VectorXd direction =
        scale.asDiagonal() *
        (scaled + 1e-9 * Eigen::MatrixXd::Identity(size, size)).ldlt().solve(scale.cwiseProduct(gradient));
    if (!direction.allFinite()) break;
    double length = 1;
    bool has_moved = false;
    double change = 0;
    for (int halving = 0; halving < 30 && !has_moved; ++halving, length *= 0.5) {
      Eigen::Vector3d next = variances;
      for (Eigen::Index a = 0; a < size; ++a) {
        const int k = free[static_cast<size_t>(a)];
        next[k] = std::max(k == 0 ? kMinPixelVariance : 0.0, variances[k] + length * direction[a]);
      }
      const Likelihood there = Evaluate(views, next);
      if (!(there.minus_log <= here.minus_log)) continue;
      has_moved = true;
      for (Eigen::Index a = 0; a < size; ++a) {
        const int k = free[static_cast<size_t>(a)];
        // In units of what the data can tell.
        change = std::max(change, std::abs(next[k] - variances[k]) * std::sqrt(std::max(0.0, here.fisher(k, k))));
      }
      variances = next;
      here = there;
    }
    constexpr double kSmallChange = 1e-6;
    if (!has_moved || change < kSmallChange) break;
  }
  VarianceComponents result;
  result.pixel = variances[0];
  result.translation_m2 = variances[1];
  result.rotation_rad2 = variances[2];
  std::vector<int> uncertain;
  for (int k = 0; k < 3; ++k) {
    if (!may_move[static_cast<size_t>(k)] || !(here.fisher(k, k) > 0)) continue;
    result.stddev[k] = 1 / std::sqrt(here.fisher(k, k));
    // One that the data have put to zero is taken as such, and so is one that they cannot tell from it: it is more
    // likely too large than too small, so that the covariance is wide enough by itself.
    constexpr double kToldFromZero = 0.75;
    if (result.stddev[k] < kToldFromZero * variances[k]) uncertain.push_back(k);
  }
  const Eigen::Index size = static_cast<Eigen::Index>(uncertain.size());
  if (size > 0) {
    Eigen::MatrixXd fisher = here.fisher(uncertain, uncertain);
    const Eigen::VectorXd scale = fisher.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd inverse =
        (scale.asDiagonal() * fisher * scale.asDiagonal()).ldlt().solve(Eigen::MatrixXd::Identity(size, size));
    result.covariance(uncertain, uncertain) = scale.asDiagonal() * inverse * scale.asDiagonal();
  }
  return result;
}

double DegreesOfFreedom(const std::vector<LinearView>& all_views, const VarianceComponents& variances) {
  CHECK(!all_views.empty());
  constexpr double kCertain = std::numeric_limits<double>::infinity();
  constexpr double kLeast = 4;
  if (variances.covariance.isZero(0)) return kCertain;
  const std::vector<LinearView> views = Condensed(all_views);
  const Eigen::Index n = views.front().by_unknowns.cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  // How the information falls with each variance: J^T S^-1 V_k S^-1 J.
  std::array<Eigen::MatrixXd, 3> falls;
  for (Eigen::MatrixXd& matrix : falls) matrix = Eigen::MatrixXd::Zero(n, n);
  for (const LinearView& view : views) {
    const Eigen::LLT<Eigen::MatrixXd> factor(
        MarginalCovariance(view, variances.pixel, variances.translation_m2, variances.rotation_rad2));
    const Eigen::MatrixXd weighted = factor.solve(view.by_unknowns);
    information += view.by_unknowns.transpose() * weighted;
    falls[0] += weighted.transpose() * weighted;
    const Eigen::MatrixXd by_translation = view.by_correction.leftCols<3>().transpose() * weighted;
    const Eigen::MatrixXd by_rotation = view.by_correction.rightCols<3>().transpose() * weighted;
    falls[1] += by_translation.transpose() * by_translation;
    falls[2] += by_rotation.transpose() * by_rotation;
  }
  // In coordinates in which the covariance is the identity, and the variances' effects apart as far as they can be.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> root(scale.asDiagonal() * information * scale.asDiagonal());
  if (root.info() != Eigen::Success) return kLeast;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < 3; ++k) {
    Eigen::MatrixXd& fall = falls[static_cast<size_t>(k)];
    fall = (scale.asDiagonal() * fall * scale.asDiagonal()).eval();
    fall = root.matrixL().solve(fall).eval();
    fall = root.matrixL().solve(fall.transpose()).eval();
    total += std::sqrt(variances.covariance(k, k)) * fall;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(total);
  double sum = 0;
  for (Eigen::Index m = 0; m < n; ++m) {
    Eigen::Vector3d slope;
    for (int k = 0; k < 3; ++k) {
      slope[k] = eigen.eigenvectors().col(m).dot(falls[static_cast<size_t>(k)] * eigen.eigenvectors().col(m));
    }
    const double dof = 2 / slope.dot(variances.covariance * slope);
    if (dof <= 2) return kLeast;
    sum += dof / (dof - 2);
  }
  return sum > static_cast<double>(n) ? std::max(kLeast, 2 * sum / (sum - static_cast<double>(n))) : kCertain;
}

}  // namespace heba
