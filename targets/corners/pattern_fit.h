// The fit of a flat pattern of axis-aligned rectangles (a tag, the squares around a chessboard corner) to all grey
// values that it covers in an image.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/corners/cell_pattern.h"

namespace heba {

// Selects the terms by which the map from the pattern to the image may differ from its initial guess.
enum class MapFreedom {
  kAffine,     // 6 terms, for patterns too small to show perspective or lens distortion.
  kQuadratic,  // 12 terms: perspective and lens distortion to second order.
  // 10 terms: perspective and a lens that is radial about the image centre; 20 terms (squares and cubes) if the grey
  // values require them. For large patterns.
  kStrongLens,
};

struct PatternFitOptions {
  // Bounds of the rectangle of the pattern whose pixels are used.
  Eigen::Vector2d min_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_m = Eigen::Vector2d::Zero();
  MapFreedom freedom = MapFreedom::kQuadratic;
  // Expected square terms for kQuadratic (x^2, x y, y^2 of coordinates from -1 to 1 over the used rectangle) from
  // other measurements, and their sigma; a sigma of 0 means that nothing is expected.
  Eigen::Matrix<double, 2, 3> squares_px = Eigen::Matrix<double, 2, 3>::Zero();
  double squares_sigma_px = 0;
  double max_move_px = 2;  // Largest move of a wanted point from the initial guess.
  double min_contrast_grey = 8;
  // Largest ratio of the residuals' RMS to the contrast; beyond it, the image shows something else.
  double max_residual_ratio = 0.15;
};

struct PatternFit {
  std::vector<Eigen::Vector2d> pixels;  // Positions of the wanted points.
  Eigen::MatrixXd covariance_px2;       // Covariance of (u, v, u, v, ...), from the residuals.
  double blur_sigma_px = 0;             // Blur sigma of the edges, RMS over directions, including a pixel's own width.
  double contrast_grey = 0;             // White minus black.
  double residual_ratio = 0;            // Ratio of the residuals' RMS to the contrast: noise and misfit.
  double outlier_share = 0;             // Share of the used pixels that deviate by more than a third of the contrast.
};

// Estimates the maximum likelihood position of a pattern in an image (CV_8UC1). The model is the pattern's albedo,
// mapped to the image and blurred by a Gaussian (exact if the map is linear within the blur: cells follow the
// bivariate normal distribution), between a black and a white level, under illumination with a gradient (for
// kStrongLens also with a curvature). The Gaussian is isotropic unless the grey values of a large pattern (kStrongLens)
// require another one: an image that moved during the exposure. Huber's loss downweights deviating pixels.
// `start_image_from_pattern` is a homography that must be correct to about a blur's width. Returns nothing if the fit
// fails or exceeds the limits in `options`, if the pattern covers too few pixels or is larger than 2000 px, or if at
// least a quarter as many of its pixels lie outside the image as are used.
std::optional<PatternFit> FitPattern(const cv::Mat& grey, const CellPattern& pattern,
                                     const Eigen::Matrix3d& start_image_from_pattern,
                                     const std::vector<Eigen::Vector2d>& wanted_m, const PatternFitOptions& options);

}  // namespace heba
