// A report shows this of a finished run. A single camera is a rig with one camera whose parts have no names.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/run_result.h"
#include "heba/run_types.h"

namespace heba {

// One image of a camera. Residuals are predicted minus observed, px.
struct ReportedImage {
  size_t entry = 0;   // Index in RunResult::images.
  std::string title;  // The dialog that shows the image has this title.
  // RMS of the inliers, with the corrections of the arms if there are any; nothing if the image was not used.
  std::optional<double> rms_px;
  // The points that the estimate used.
  Points2 pixels = Points2(2, 0);
  Points2 residuals = Points2(2, 0);
  // The points that it left out; all points if the image was not used.
  Points2 left_out_pixels = Points2(2, 0);
  Points2 left_out_residuals = Points2(2, 0);
  std::string small_jpeg;
};

// The images of one camera. Their residuals are those that remain after the corrections of the arms, which are to be
// compared with the noise of the pixels.
struct CameraResiduals {
  Camera camera;
  double sigma_px = 0;
  std::optional<double> rms_px;       // Over the inliers of all images.
  std::vector<ReportedImage> images;  // In the order of RunResult::images.
};

// The page shows these data.
struct ReportData {
  // The corrections of its captures are without the errors that captures share.
  RunResult result;
  std::vector<Points3> target_points;               // One per target: all points in its frame, m.
  std::vector<std::optional<Camera>> true_cameras;  // One per camera, or empty.
  // One per camera; empty if poses of the targets were given in place of images.
  std::vector<CameraResiduals> residuals;
  bool has_corrections = false;  // Whether the poses of the arms were corrected.

  bool has_images() const { return !residuals.empty(); }
};

ReportData ReportDataOf(const RunOutput& run);

}  // namespace heba
