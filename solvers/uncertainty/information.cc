#include "solvers/uncertainty/information.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "heba/base/factorisation.h"
#include "heba/base/text.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// Returns the inverse square roots of the diagonal, or zero for elements that are not positive.
Eigen::VectorXd ScaleOf(const Eigen::MatrixXd& matrix) {
  return matrix.diagonal().unaryExpr([](double d) { return d > 0 ? 1.0 / std::sqrt(d) : 0.0; });
}

}  // namespace

std::string IntrinsicsKey(const UnknownBlock& block) {
  constexpr std::string_view kOfRig = "cameras.";
  const std::string key = "refine.intrinsics";
  return block.name.starts_with(kOfRig) ? block.name.substr(0, block.name.rfind('.') + 1) + key : key;
}

std::optional<Failure> CheckObservable(const Information& information) {
  constexpr double kMinEigenvalue = 1e-9;
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    if (scale[i] != 0) continue;
    const UnknownBlock& block = information.layout.BlockAt(i);
    const std::string cure = block.owner == UnknownOwner::kCamera
                                 ? "; hold it with a camera file and " + IntrinsicsKey(block)
                                 : std::string();
    return Failure{"the data do not determine " + information.layout.PlainName(i) + cure};
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
  // Parameters that can be held by the config come first; poses cannot be held.
  const auto owner_of = [&](Eigen::Index i) { return information.layout.BlockAt(i).owner; };
  const double limit = 0.3 * std::abs(direction[order.front()]);
  order.erase(std::remove_if(order.begin(), order.end(), [&](int i) { return std::abs(direction[i]) < limit; }),
              order.end());
  std::stable_partition(order.begin(), order.end(), [&](int i) { return owner_of(i) != UnknownOwner::kPose; });
  std::vector<std::string> parts;
  std::vector<std::string> keys;  // The keys of a config that hold the intrinsics.
  bool has_shape = false;
  for (const int i : order) {
    if (owner_of(i) == UnknownOwner::kCamera) {
      const std::string key = IntrinsicsKey(information.layout.BlockAt(i));
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    }
    has_shape = has_shape || owner_of(i) == UnknownOwner::kTarget;
    constexpr size_t kMaxParts = 3;
    if (parts.size() < kMaxParts) parts.push_back(information.layout.PlainName(i));
  }
  std::vector<std::string> cures = {"move the target through more depth and tilt"};
  if (!keys.empty()) cures.push_back("hold intrinsics (" + Join(keys, ", ") + ")");
  if (has_shape) cures.emplace_back("hold the target's shape (refine.target_shape)");
  return Failure{"the captures do not determine " + Join(parts, " together with ") + "; " + Join(cures, ", or ") + ""};
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
