#include "python/bindings/arrays.h"

namespace heba {

cv::Mat MatOf(const GreyArray& grey) {
  return {static_cast<int>(grey.shape(0)), static_cast<int>(grey.shape(1)), CV_8UC1,
          const_cast<uint8_t*>(grey.data())};  // NOLINT(cppcoreguidelines-pro-type-const-cast): detectors only read.
}

std::vector<Rigid3d> PosesFrom(const DoubleArray& matrices) {
  const auto numbers = matrices.unchecked<3>();
  std::vector<Rigid3d> poses;
  for (pybind11::ssize_t i = 0; i < numbers.shape(0); ++i) {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) rotation(row, column) = numbers(i, row, column);
      translation[row] = numbers(i, row, 3);
    }
    poses.emplace_back(NearestRotation(rotation), translation);
  }
  return poses;
}

pybind11::array_t<double> ArrayOf(const Rigid3d& pose) { return ArrayOf(Eigen::MatrixXd(pose.Matrix())); }

pybind11::array_t<double> ArrayOf(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  pybind11::array_t<double> array({matrix.rows(), matrix.cols()});
  auto numbers = array.mutable_unchecked<2>();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) numbers(row, column) = matrix(row, column);
  }
  return array;
}

}  // namespace heba
