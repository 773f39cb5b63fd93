// The report.html of a run: the verdict first, then the evidence for it. The page needs no other file.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/evaluation/evaluation.h"
#include "tools/pages/report_record.h"

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

// Returns the page. `target_points` are all points of the target in its frame, m. If `result` has no refined
// estimate, `captures` is empty.
std::string ReportPage(const RunResult& result, const std::vector<ReportedCapture>& captures,
                       const Points3& target_points, const ReportContext& context);

}  // namespace heba
