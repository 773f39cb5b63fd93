// Which camera model the lens needs, from the captures alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/problem.h"

namespace heba {

struct CameraAlternative {
  std::string model;
  double log_likelihood = 0;  // Every view has a pose of its own; a constant is common to all models.
  int dof = 0;                // Parameters of the camera.
  // The chance of so large a gain of the larger model that it was compared with, if this model is right; nothing for a
  // model that was compared with none.
  std::optional<double> p;
};

struct CameraChoice {
  Camera camera;
  std::vector<CameraAlternative> alternatives;  // In the order in which they were tried.
};

// Estimates pinhole, brown4, brown5 and rational8 (EstimateIntrinsics) and takes the smallest that the residuals do not
// reject: a larger model must be more likely by a chi-square test at 1 %, and by one sigma over the views as
// independent samples (Vuong 1989), since errors within a view are not. Where points are seen more than 50 deg off the
// axis, or where no polynomial model could be estimated, kannala_brandt4 is tried too, and taken if it is more likely.
// A Failure if no model could be estimated.
Outcome<CameraChoice> ChooseCameraModel(const std::vector<View>& views, int width_px, int height_px);

}  // namespace heba
