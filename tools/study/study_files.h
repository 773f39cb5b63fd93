// The files of a finished study.
#pragma once

#include <filesystem>
#include <vector>

#include "tools/study/study_rows.h"

namespace heba {

// Writes the config, the table, the page and the rows of a study into its folder. `results` are those of all cells.
void WriteStudy(const StudyConfig& study, const std::vector<CellResult>& results, const std::filesystem::path& folder);

}  // namespace heba
