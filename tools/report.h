// A run's report.html: the verdict first, then what it rests on. One page that needs no other file.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

// What the refined estimate leaves of a capture's points: where they were seen, and predicted minus seen, px.
struct CaptureResiduals {
  std::string image;
  Points2 pixels;
  Points2 residuals;
};

std::string ReportPage(const RunResult& result, const std::vector<CaptureResiduals>& residuals);

}  // namespace heba
