// The picture of a target with the deviations of its points from the shape that was estimated.
#pragma once

#include <string>

#include "tools/pages/report_data.h"

namespace heba {

// Returns the markup of the pictures of all targets with points that deviate; empty if none do.
std::string TargetFigures(const ReportData& data);

}  // namespace heba
