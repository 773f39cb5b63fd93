// A capture as a report shows it.
#pragma once

#include <string>

#include "heba/camera/camera_model.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The data of a capture that the report shows in addition to its CaptureResult.
struct ReportedCapture {
  std::string image;  // Same as in CaptureResult.
  Rigid3d base_from_gripper;
  // Observed positions of the inliers of the refined estimate, and residuals (predicted minus observed), px.
  Points2 pixels;
  Points2 residuals;
  // The same for the points that the estimate left out; all points if the capture was not used.
  Points2 left_out_pixels;
  Points2 left_out_residuals;
  std::string small_jpeg;
};

}  // namespace heba
