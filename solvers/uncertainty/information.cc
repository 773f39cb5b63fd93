#include "solvers/uncertainty/information.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "heba/base/text.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// Returns the inverse square roots of the diagonal, or zero for elements that are not positive.
Eigen::VectorXd ScaleOf(const Eigen::MatrixXd& matrix) {
  return matrix.diagonal().unaryExpr([](double d) { return d > 0 ? 1.0 / std::sqrt(d) : 0.0; });
}

Eigen::MatrixXd InverseOf(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return factor.solve(Eigen::MatrixXd::Identity(factor.rows(), factor.rows()));
}

}  // namespace

std::vector<std::string> UnknownNames(const CameraModel& model, const FreeParameters& free) {
  std::vector<std::string> names;
  for (const char* pose : {"hand_eye.", "board."}) {
    for (const std::string_view tangent : kTangentNames) names.push_back(pose + std::string(tangent));
  }
  const size_t num_camera = static_cast<size_t>(NumParams(model));
  for (size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) continue;
    names.push_back(i < num_camera ? "camera." + model.param_names()[i]
                                   : "target." + std::string(kTargetShapeParamNames[i - num_camera]));
  }
  return names;
}

std::optional<Failure> CheckObservable(const Information& information) {
  constexpr double kMinEigenvalue = 1e-9;
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    if (scale[i] == 0)
      return Failure{"the data do not determine " + PlainName(information.names[static_cast<size_t>(i)])};
  }
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.matrix * scale.asDiagonal();
  // A lower bound of the smallest eigenvalue usually suffices: one divided by the norm of the inverse.
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() == Eigen::Success && InverseOf(factor).norm() <= 1 / kMinEigenvalue) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (eigen.eigenvalues()[0] >= kMinEigenvalue) return std::nullopt;
  // The largest components of the unobservable direction, in scaled units.
  const Eigen::VectorXd direction = eigen.eigenvectors().col(0);
  std::vector<int> order(static_cast<size_t>(direction.size()));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(direction[a]) > std::abs(direction[b]); });
  // Parameters that can be held by the config come first; poses cannot be held.
  const auto is_pose = [&](int i) { return i < 12; };
  const double limit = 0.3 * std::abs(direction[order.front()]);
  order.erase(std::remove_if(order.begin(), order.end(), [&](int i) { return std::abs(direction[i]) < limit; }),
              order.end());
  std::stable_partition(order.begin(), order.end(), [&](int i) { return !is_pose(i); });
  std::vector<std::string> parts;
  bool has_camera = false;
  bool has_shape = false;
  for (const int i : order) {
    const std::string& name = information.names[static_cast<size_t>(i)];
    has_camera = has_camera || name.starts_with("camera.");
    has_shape = has_shape || name.starts_with("target.");
    constexpr size_t kMaxParts = 3;
    if (parts.size() < kMaxParts) parts.push_back(PlainName(name));
  }
  std::vector<std::string> cures = {"move the target through more depth and tilt"};
  if (has_camera) cures.emplace_back("hold intrinsics (refine.intrinsics)");
  if (has_shape) cures.emplace_back("hold the target's shape (refine.target_shape)");
  return Failure{"the captures do not determine " + Join(parts, " together with ") + "; " + Join(cures, ", or ") + ""};
}

Covariance InvertInformation(const Information& information, double factor) {
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.matrix * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> root(scaled);
  if (root.info() == Eigen::Success) {
    return {information.names, factor * (scale.asDiagonal() * InverseOf(root) * scale.asDiagonal())};
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::MatrixXd half = scale.asDiagonal() * eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseMax(1e-300).cwiseSqrt().cwiseInverse().asDiagonal();
  return {information.names, factor * half * half.transpose()};
}

Eigen::VectorXd AxialFocalLengthByUnknowns(const Camera& camera, int axis, const std::vector<std::string>& names) {
  const Eigen::VectorXd by_params = AxialFocalLengthByParams(camera, axis);
  const std::vector<std::string>& params = camera.Model().param_names();
  Eigen::VectorXd by_unknowns = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
  for (size_t i = 0; i < params.size(); ++i) {
    const auto found = std::find(names.begin(), names.end(), "camera." + params[i]);
    if (found != names.end()) by_unknowns[found - names.begin()] = by_params[static_cast<Eigen::Index>(i)];
  }
  return by_unknowns;
}

std::string PlainName(const std::string& name) {
  const size_t dot = name.find('.');
  const std::string owner = name.substr(0, dot);
  const std::string part = name.substr(dot + 1);
  if (owner == "camera") return "the camera's " + part;
  if (owner == "target") return "the target's " + part.substr(0, part.find('_')) + " along " + part[part.find('_') + 1];
  const std::string frame = owner == "hand_eye" ? "the camera's " : "the target's ";
  return std::string(owner == "hand_eye" ? "the hand-eye " : "the board's ") +
         (part[0] == 't' ? "translation along " : "rotation about ") + frame + part[1];
}

}  // namespace heba
