// Conversions between numpy arrays and heba's types. The package in Python has checked shapes, numbers and rotations.
#pragma once

#include <cstdint>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <opencv2/core/mat.hpp>

#include "heba/geometry/rigid3.h"

namespace heba {

// A C-contiguous array of double; others are converted, without a copy if they are such an array already.
using DoubleArray = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

// A contiguous grey image.
using GreyArray = pybind11::array_t<uint8_t, pybind11::array::c_style>;

// Returns the image without a copy of its pixels, which must not be changed.
cv::Mat MatOf(const GreyArray& grey);
// Reads n x 4 x 4 matrices.
std::vector<Rigid3d> PosesFrom(const DoubleArray& matrices);
// Returns the 4 x 4 matrix.
pybind11::array_t<double> ArrayOf(const Rigid3d& pose);
// Returns a copy of a matrix.
pybind11::array_t<double> ArrayOf(const Eigen::Ref<const Eigen::MatrixXd>& matrix);

}  // namespace heba
