// Refines the outline of a dot to sub-pixel accuracy.
#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/dots/ellipse.h"

namespace heba {

struct RefineEllipseOptions {
  // Maximum distance from the outline of the pixels used; it must be less than the distance to the next structure.
  double max_margin_px = 12;
  // Scale of the next structure, as a multiple of the outline about its centre; pixels that its blurred edge reaches
  // are not used. 0 if there is none.
  double next_outline_ratio = 0;
  // Reach of that edge in standard deviations of its blur: 0.6 % of the step lies beyond 2.5.
  double next_reach_sigmas = 2.5;
};

struct RefinedEllipse {
  Ellipse ellipse;
  double contrast_grey = 0;   // Inside minus outside, at the outline.
  double blur_sigma_px = 0;   // Sigma of the outline's blur, including a pixel's own width.
  double residual_ratio = 0;  // RMS of the fit's residuals divided by the contrast: noise and misfit.
  // Covariance of the centre in px^2, estimated from the residuals.
  Eigen::Matrix2d centre_covariance_px2 = Eigen::Matrix2d::Zero();
  double visible_ratio = 1;  // Share of the outline that agrees with an ellipse; the rest was not used.

  // Returns the square root of the mean variance of the centre's coordinates.
  double CentreStddevPx() const { return std::sqrt(0.5 * centre_covariance_px2.trace()); }
};

// Fits the most likely ellipse with a blurred edge to the pixels beside its outline. The model has two surfaces under
// a light that varies linearly (if the image requires it, the grey value inside varies linearly too) and an error
// function as the edge between them. Deviating pixels are down-weighted (Huber), and parts of the outline that do not
// agree with the rest are ignored. `grey` is CV_8UC1 or CV_32FC1. `start` must be accurate to a third of its radius.
// Returns nothing if there is no such ellipse near `start`, or if the border of the image cuts off more of it than a
// tenth of its radius.
std::optional<RefinedEllipse> RefineEllipse(const cv::Mat& grey, const Ellipse& start,
                                            const RefineEllipseOptions& options = {});

}  // namespace heba
