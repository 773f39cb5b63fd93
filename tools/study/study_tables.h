// A finished study as a table for the terminal and as study.csv.
#pragma once

#include <string>
#include <vector>

#include "tools/study/study_rows.h"

namespace heba {

// Returns a table of at most 80 characters' width for each cell.
std::string StudyTable(const std::vector<CellResult>& results);

// Returns a header and one line for each cell, pose and method. Lengths are in mm, angles in deg, focal lengths in px;
// a missing figure is empty. The columns of the hand-eye pose are those of the column `pose`.
std::string StudyCsv(const std::vector<CellResult>& results);

}  // namespace heba
