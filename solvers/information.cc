#include "solvers/information.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "heba/base/text.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// The diagonal's inverse roots; zero where the diagonal is.
Eigen::VectorXd ScaleOf(const Eigen::MatrixXd& matrix) {
  return matrix.diagonal().unaryExpr([](double d) { return d > 0 ? 1.0 / std::sqrt(d) : 0.0; });
}

}  // namespace

FreeParameters FreeOf(const CameraModel& model, const std::vector<ParameterGroup>& free_groups) {
  FreeParameters free(static_cast<size_t>(NumParams(model)));
  for (size_t i = 0; i < free.size(); ++i) {
    free[i] = std::find(free_groups.begin(), free_groups.end(), GroupOf(static_cast<int>(i))) != free_groups.end();
  }
  return free;
}

std::vector<std::string> UnknownNames(const CameraModel& model, const FreeParameters& free) {
  std::vector<std::string> names;
  for (const char* pose : {"hand_eye.", "board."}) {
    for (const std::string_view tangent : kTangentNames) names.push_back(pose + std::string(tangent));
  }
  for (size_t i = 0; i < free.size(); ++i) {
    if (free[i]) names.push_back("camera." + model.param_names()[i]);
  }
  return names;
}

std::optional<Failure> CheckObservable(const Information& information) {
  constexpr double kMinEigenvalue = 1e-9;
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    if (scale[i] == 0) return Failure{"the data do not see " + PlainName(information.names[static_cast<size_t>(i)])};
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information.matrix *
                                                             scale.asDiagonal());
  if (eigen.eigenvalues()[0] >= kMinEigenvalue) return std::nullopt;
  // The largest parts of the direction that nothing sees, in scaled units.
  const Eigen::VectorXd direction = eigen.eigenvectors().col(0);
  std::vector<int> order(static_cast<size_t>(direction.size()));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(direction[a]) > std::abs(direction[b]); });
  std::vector<std::string> parts;
  for (const int i : order) {
    if (parts.size() == 3 || std::abs(direction[i]) < 0.3 * std::abs(direction[order[0]])) break;
    parts.push_back(PlainName(information.names[static_cast<size_t>(i)]));
  }
  return Failure{"the captures do not determine " + Join(parts, " together with ") +
                 ": moving the target through more depth and tilt, or holding intrinsics (refine.intrinsics), would"};
}

Covariance InvertInformation(const Information& information, double factor) {
  const Eigen::VectorXd scale = ScaleOf(information.matrix);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information.matrix *
                                                             scale.asDiagonal());
  const Eigen::MatrixXd half = scale.asDiagonal() * eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseMax(1e-300).cwiseSqrt().cwiseInverse().asDiagonal();
  return {information.names, factor * half * half.transpose()};
}

std::string PlainName(const std::string& name) {
  const size_t dot = name.find('.');
  const std::string owner = name.substr(0, dot);
  const std::string part = name.substr(dot + 1);
  if (owner == "camera") return "the camera's " + part;
  const std::string frame = owner == "hand_eye" ? "the camera's " : "the target's ";
  return std::string(owner == "hand_eye" ? "the hand-eye " : "the board's ") +
         (part[0] == 't' ? "translation along " : "rotation about ") + frame + part[1];
}

}  // namespace heba
