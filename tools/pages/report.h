// A run's report.html: the verdict first, then what it rests on. One page that needs no other file.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/evaluation/evaluation.h"
#include "tools/pages/report_record.h"

namespace heba {

// What the report shows of a capture beside its CaptureResult.
struct ReportedCapture {
  std::string image;  // As in CaptureResult.
  Rigid3d base_from_gripper;
  // What the refined estimate leaves of its points: where they were seen, and predicted minus seen, px.
  Points2 pixels;
  Points2 residuals;
  // Likewise of the points that the estimate left out, all of them in a capture that was not used.
  Points2 left_out_pixels;
  Points2 left_out_residuals;
  std::string small_jpeg;
};

// `target_points` are all of the target's, in its frame, m. A result without a refined estimate has no `captures`.
std::string ReportPage(const RunResult& result, const std::vector<ReportedCapture>& captures,
                       const Points3& target_points, const ReportContext& context);

}  // namespace heba
