// The report.html of a run with a rig: the verdict first, then the cell, the cameras, their residuals and the poses
// between them. The page needs no other file.
#pragma once

#include <string>

#include "heba/rig_run.h"
#include "tools/pages/report_record.h"

namespace heba {

std::string RigReportPage(const RigDataset& dataset, const RigRunOutput& run, const ReportContext& context);

}  // namespace heba
