// A photograph of the target with its detections, which is visible without the page's script.
#pragma once

#include <string>

#include "tools/pages/report_data.h"

namespace heba {

// Returns the markup of the image in which the estimate uses the most points; empty if there is no photograph.
std::string BestPhotograph(const ReportData& data);

}  // namespace heba
