#include "solvers/uncertainty/information.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// Returns the inverse square roots of the diagonal, or zero for elements that are not positive.
Eigen::VectorXd ScaleOf(const Eigen::MatrixXd& matrix) {
  return matrix.diagonal().unaryExpr([](double d) { return d > 0 ? 1.0 / std::sqrt(d) : 0.0; });
}

}  // namespace

std::optional<Failure> CheckObservable(const Information& information) {
  constexpr double kMinEigenvalue = 1e-9;
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    if (scale[i] != 0) continue;
    Failure failure{FailureCode("no_information"), {}, {{"unknown", information.layout.Name(i)}}};
    const UnknownBlock& block = information.layout.BlockAt(i);
    if (block.owner == UnknownOwner::kCamera) failure.names.emplace_back("of_camera", block.name);
    return failure;
  }
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.matrix * scale.asDiagonal();
  // A lower bound of the smallest eigenvalue usually suffices: one divided by the norm of the inverse.
  const auto root = Cholesky(scaled);
  if (root && root->Inverse().norm() <= 1 / kMinEigenvalue) return std::nullopt;
  const SymmetricEigen<Eigen::Dynamic> eigen = EigenOfSymmetric(scaled);
  if (eigen.values[0] >= kMinEigenvalue) return std::nullopt;
  // The largest components of the unobservable direction, in scaled units.
  const Eigen::VectorXd direction = eigen.vectors.col(0);
  std::vector<int> order(static_cast<size_t>(direction.size()));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(direction[a]) > std::abs(direction[b]); });
  // Parameters that can be held come first; poses cannot be held.
  const auto owner_of = [&](Eigen::Index i) { return information.layout.BlockAt(i).owner; };
  const double limit = 0.3 * std::abs(direction[order.front()]);
  order.erase(std::remove_if(order.begin(), order.end(), [&](int i) { return std::abs(direction[i]) < limit; }),
              order.end());
  std::stable_partition(order.begin(), order.end(), [&](int i) { return owner_of(i) != UnknownOwner::kPose; });
  Failure failure{FailureCode("undetermined")};
  size_t num_named = 0;
  for (const int i : order) {
    // The parts that can be held: the intrinsics of a camera, and the shape of targets.
    const UnknownBlock& block = information.layout.BlockAt(i);
    const bool is_camera = block.owner == UnknownOwner::kCamera;
    const std::pair<std::string, std::string> part{is_camera ? "of_camera" : "of_target", block.name};
    const bool is_known = std::find(failure.names.begin(), failure.names.end(), part) != failure.names.end();
    if ((is_camera || block.owner == UnknownOwner::kTarget) && !is_known) failure.names.push_back(part);
    constexpr size_t kMostNamed = 3;
    if (num_named++ < kMostNamed) failure.names.emplace_back("unknown", information.layout.Name(i));
  }
  return failure;
}

Covariance InvertInformation(const Information& information, double factor) {
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.matrix * scale.asDiagonal();
  if (const auto root = Cholesky(scaled)) {
    return {information.layout, factor * (scale.asDiagonal() * root->Inverse() * scale.asDiagonal())};
  }
  const SymmetricEigen<Eigen::Dynamic> eigen = EigenOfSymmetric(scaled);
  const Eigen::MatrixXd half =
      scale.asDiagonal() * eigen.vectors * eigen.values.cwiseMax(1e-300).cwiseSqrt().cwiseInverse().asDiagonal();
  return {information.layout, factor * half * half.transpose()};
}

Eigen::VectorXd AxialFocalLengthByUnknowns(const Camera& camera, int axis, const UnknownLayout& layout,
                                           const UnknownBlock& block) {
  const Eigen::VectorXd by_params = AxialFocalLengthByParams(camera, axis);
  Eigen::VectorXd by_unknowns = Eigen::VectorXd::Zero(layout.size());
  for (Eigen::Index i = block.first; i < block.end(); ++i) by_unknowns[i] = by_params[layout[i].index];
  return by_unknowns;
}

}  // namespace heba
