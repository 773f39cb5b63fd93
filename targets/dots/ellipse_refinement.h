// Exactly where a dot's outline is.
#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/dots/ellipse.h"

namespace heba {

struct RefineEllipseOptions {
  // How far from the outline pixels are used at most: less than the distance to whatever is next.
  double max_margin_px = 12;
  // Where, as a multiple of the outline about its centre, something else begins: pixels that its blurred edge reaches
  // are not used. 0 if there is nothing.
  double next_outline_ratio = 0;
  // How far, in standard deviations of its blur: beyond 2.5 lie 0.6 % of its step.
  double next_reach_sigmas = 2.5;
};

struct RefinedEllipse {
  Ellipse ellipse;
  double contrast_grey = 0;   // Inside minus outside, at the outline.
  double blur_sigma_px = 0;   // Of the outline, a pixel's own width included.
  double residual_ratio = 0;  // RMS of the fit's residuals by the contrast: noise and misfit.
  // Of the centre, px^2, as the residuals tell it.
  Eigen::Matrix2d centre_covariance_px2 = Eigen::Matrix2d::Zero();
  double visible_ratio = 1;  // Share of the outline that agrees with an ellipse; the rest was not used.

  // Root of the mean variance of the centre's coordinates.
  double CentreStddevPx() const { return std::sqrt(0.5 * centre_covariance_px2.trace()); }
};

// The ellipse with a blurred edge that is most likely given the pixels beside its outline: two surfaces under a light
// that is a plane (if the picture asks for it, the one inside is a plane too), the edge between them an error function;
// deviating pixels count less (Huber), parts of the outline that do not agree with the rest do not count. `start` must
// be right to a third of its radius. Nothing if there is no such ellipse near `start`, or if the picture's border cuts
// off more of it than a tenth of its radius.
std::optional<RefinedEllipse> RefineEllipse(const cv::Mat& grey, const Ellipse& start,
                                            const RefineEllipseOptions& options = {});

}  // namespace heba
