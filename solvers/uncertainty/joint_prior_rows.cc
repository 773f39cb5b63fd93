#include "solvers/uncertainty/joint_prior_rows.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"

namespace heba {
namespace {

// Returns the derivative of LocalCoordinates(mean, Retract(x, step)) by the step, at zero, where `difference` is
// LocalCoordinates(mean, x). That of the rotation is the inverse right Jacobian of SO(3).
Eigen::Matrix<double, 6, 6> DifferenceByStep(const Tangent6& difference) {
  const Eigen::Vector3d rotation = difference.tail<3>();
  const double angle = rotation.norm();
  const Eigen::Matrix3d cross = Skew(rotation);
  constexpr double kSmall = 1e-4;  // The next term of the series is below 1e-11.
  const double factor =
      angle < kSmall ? 1.0 / 12 : 1 / (angle * angle) - (1 + std::cos(angle)) / (2 * angle * std::sin(angle));
  Eigen::Matrix<double, 6, 6> by_step = Eigen::Matrix<double, 6, 6>::Zero();
  by_step.topLeftCorner<3, 3>() = ExpRotation(rotation).toRotationMatrix();
  by_step.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() + 0.5 * cross + factor * cross * cross;
  return by_step;
}

}  // namespace

std::vector<Eigen::Index> PlacesIn(const UnknownLayout& layout, const JointPrior& prior) {
  const UnknownLayout& known = prior.covariance.layout;
  std::vector<Eigen::Index> places;
  for (const UnknownBlock& block : known.blocks()) {
    const bool has_owner = std::any_of(layout.blocks().begin(), layout.blocks().end(),
                                       [&](const UnknownBlock& other) { return other.name == block.name; });
    for (Eigen::Index k = block.first; has_owner && k < block.end(); ++k) places.push_back(k);
  }
  return places;
}

PriorDifferences DifferencesFrom(const JointPrior& prior, const UnknownLayout& layout, const LoopValues& values) {
  const UnknownLayout& known = prior.covariance.layout;
  Eigen::VectorXd differences = Eigen::VectorXd::Zero(known.size());
  Eigen::MatrixXd by_unknowns = Eigen::MatrixXd::Zero(known.size(), layout.size());
  const auto add_params = [&](const UnknownBlock& block, const auto& params) {
    const UnknownBlock of_prior = known.Block(block.name);
    for (Eigen::Index k = of_prior.first; k < of_prior.end(); ++k) {
      const auto param = static_cast<size_t>(known[k].index);
      differences[k] = params[param] - prior.params.at(block.name)[param];
      for (Eigen::Index i = block.first; i < block.end(); ++i) {
        if (layout[i].index == known[k].index) by_unknowns(k, i) = 1;
      }
    }
  };
  size_t pose = 0;
  size_t camera = 0;
  size_t target = 0;
  for (const UnknownBlock& block : layout.blocks()) {
    switch (block.owner) {
      case UnknownOwner::kPose: {
        const Rigid3d& value = values.poses[pose++];
        const UnknownBlock of_prior = known.Block(block.name);
        if (of_prior.size == 0) break;
        const Tangent6 difference = LocalCoordinates(prior.poses.at(block.name), value);
        differences.segment<6>(of_prior.first) = difference;
        by_unknowns.block<6, 6>(of_prior.first, block.first) = DifferenceByStep(difference);
        break;
      }
      case UnknownOwner::kCamera:
        add_params(block, values.cameras[camera++]);
        break;
      case UnknownOwner::kTarget:
        add_params(block, values.targets[target++].params);
        break;
      case UnknownOwner::kEffects:
        break;
    }
  }
  return {std::move(differences), std::move(by_unknowns)};
}

JointPriorRows RowsOf(const JointPrior& prior, const UnknownLayout& layout, const LoopValues& values) {
  const PriorDifferences differences = DifferencesFrom(prior, layout, values);
  const std::vector<Eigen::Index> places = PlacesIn(layout, prior);
  const Eigen::MatrixXd covariance = prior.covariance.matrix(places, places);
  // The unknowns have different units.
  const Eigen::VectorXd scales = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const auto factor = Cholesky(Eigen::MatrixXd(scales.asDiagonal() * covariance * scales.asDiagonal()));
  CHECK(factor) << "the covariance of a prior must be positive definite";
  JointPriorRows rows{scales.cwiseProduct(differences.values(places)),
                      scales.asDiagonal() * differences.by_unknowns(places, Eigen::all).eval()};
  const auto lower = factor->lower().triangularView<Eigen::Lower>();
  lower.solveInPlace(rows.residuals);
  lower.solveInPlace(rows.by_unknowns);
  return rows;
}

LinearisedView AsView(const JointPriorRows& rows, double row_variance, Eigen::Index num_effects) {
  LinearisedView view;
  view.offset = std::sqrt(row_variance) * rows.residuals;
  view.by_unknowns = -std::sqrt(row_variance) * rows.by_unknowns;
  view.by_effects = Eigen::MatrixXd::Zero(rows.residuals.size(), num_effects);
  view.num_rows_without_effects = rows.residuals.size();
  return view;
}

}  // namespace heba
