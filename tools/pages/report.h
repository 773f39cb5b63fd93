// The report.html of a run: the verdict first, then the evidence for it. The page needs no other file.
#pragma once

#include <string>

#include "tools/pages/report_data.h"
#include "tools/pages/report_record.h"

namespace heba {

// Returns the page: the record, then each section that has content.
std::string ReportPage(const ReportData& data, const ReportContext& context);

}  // namespace heba
