// Sections of a report on the residuals of each camera.
#pragma once

#include <cstddef>
#include <string>

#include "tools/pages/report_data.h"

namespace heba {

// Returns the name under which the page holds the images of a camera (ResidualData).
std::string ImagesName(const ReportData& data, size_t camera);

// Returns the sections of all cameras, with the data of their views. Cameras without points have no charts.
std::string ResidualSections(const ReportData& data);

// Returns the markup of a section; empty if it has no content.
std::string PageSection(const std::string& heading, const std::string& content);

}  // namespace heba
