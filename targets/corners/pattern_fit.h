// Where a flat pattern of upright rectangles (a tag, the squares around a chessboard corner) lies in a picture, by all
// grey values that it covers.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/corners/cell_pattern.h"

namespace heba {

// How far the map from the pattern into the picture may leave its start.
enum class MapFreedom {
  kAffine,      // 6 numbers: for patterns so small that neither perspective nor lens is to be seen within them.
  kQuadratic,   // 12 numbers: whatever perspective and lens do to second order.
  kStrongLens,  // 10 numbers: perspective, and a lens that is radial about the picture's middle; 20 (squares and cubes)
                // if the grey values ask for them. For large patterns.
};

struct PatternFitOptions {
  // Of the pattern, the rectangle whose pixels are used.
  Eigen::Vector2d min_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_m = Eigen::Vector2d::Zero();
  MapFreedom freedom = MapFreedom::kQuadratic;
  // For kQuadratic: the squares (x^2, x y, y^2 of coordinates from -1 to 1 over the used rectangle) that other
  // measurements expect, and how far from them the pattern may be; 0 if there are none.
  Eigen::Matrix<double, 2, 3> squares_px = Eigen::Matrix<double, 2, 3>::Zero();
  double squares_sigma_px = 0;
  double max_move_px = 2;  // Of any wanted point from the start.
  double min_contrast_grey = 8;
  // RMS of the residuals by the contrast; beyond it the picture shows something else.
  double max_residual_ratio = 0.15;
};

struct PatternFit {
  std::vector<Eigen::Vector2d> pixels;  // Of the wanted points.
  Eigen::MatrixXd covariance_px2;       // Of u, v, u, v, ..., as the residuals tell it.
  double blur_sigma_px = 0;             // Of the edges, a pixel's own width included.
  double contrast_grey = 0;             // White less black.
  double residual_ratio = 0;            // RMS of the residuals by the contrast: noise and misfit.
  double outlier_share = 0;  // The share of the used pixels that deviate by more than a third of the contrast.
};

// The most likely place given the grey values: the pattern's albedo through the map, blurred by a Gaussian (exact for
// a map that is linear within the blur: cells by the bivariate normal distribution), between a black and a white level
// under light with a gradient (for kStrongLens bent); deviating pixels count less (Huber). `start_image_from_pattern`
// is a homography that must be right to about a blur's width. Nothing if there is no such pattern there, or if a
// quarter of it or more is out of the picture.
std::optional<PatternFit> FitPattern(const cv::Mat& grey, const CellPattern& pattern,
                                     const Eigen::Matrix3d& start_image_from_pattern,
                                     const std::vector<Eigen::Vector2d>& wanted_m, const PatternFitOptions& options);

}  // namespace heba
