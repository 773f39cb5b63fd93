// The report.html of a run: the verdict first, then the evidence for it. The page needs no other file.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/evaluation/evaluation.h"
#include "tools/pages/report_record.h"
#include "tools/pages/reported_capture.h"

namespace heba {

// Returns the page. `target_points` are all points of the target in its frame, m. If `result` has no refined
// estimate, `captures` is empty.
std::string ReportPage(const RunResult& result, const std::vector<ReportedCapture>& captures,
                       const Points3& target_points, const ReportContext& context);

}  // namespace heba
