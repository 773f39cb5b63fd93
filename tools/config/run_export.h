// The exports of a finished run, whose config says what its poses are.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/io/export_files.h"

namespace heba {

// Returns the poses and the arms of a result of the run in this folder (MakeExportRequests); `method` is that of its
// estimate. A config without a section of poses, or none, says nothing about them.
ExportRequests ExportRequestsOf(const std::filesystem::path& run_folder, const RunResult& result,
                                const std::string& method);

// Returns the files of the formats. A calibrated arm of a run whose verdict is bad has a reason in place of a text,
// unless `is_forced`; the reason
// ends with `how_to_force`, a clause.
std::vector<ExportedFile> FilesToExport(const std::vector<ExportFormat>& formats, const ExportRequests& requests,
                                        Grade grade, bool is_forced, const std::string& how_to_force);

}  // namespace heba
