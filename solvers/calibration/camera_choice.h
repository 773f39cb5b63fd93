// Chooses the camera model that the lens needs, from the captures alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/calibration.h"

namespace heba {

struct CameraChoice {
  Camera camera;
  std::vector<CameraAlternative> alternatives;  // Ordered as they were tried.
};

// Estimates pinhole, brown4, brown5 and rational8 (EstimateIntrinsics) and chooses the smallest model that the
// residuals do not reject. A larger model rejects it if it is more likely both by a chi-square test at 1 % and by one
// sigma with the views as independent samples (Vuong 1989), because errors within a view are not independent. If
// points lie more than 50 deg off the axis, or if no polynomial model could be estimated, kannala_brandt4 is tried too
// and chosen if it is more likely. Returns a Failure if no model could be estimated.
Outcome<CameraChoice> ChooseCameraModel(const std::vector<View>& views, int width_px, int height_px);

}  // namespace heba
