// The page of a finished study.
#pragma once

#include <string>
#include <vector>

#include "tools/study/study_rows.h"

namespace heba {

// Returns a page with charts of every varied quantity, or of the errors and bounds if nothing is varied, and a table
// row for each cell and method.
std::string StudyPage(const std::string& title, const std::vector<CellResult>& results);

}  // namespace heba
