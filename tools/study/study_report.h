// A finished study for people and programs: the table on the terminal, study.csv, plots, study.html.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/config/study_config.h"

namespace heba {

struct CellResult {
  int cell = 0;  // Its number in the study.
  StudyLabels labels;
  Outcome<StudyErrors> bound = Failure{"not run"};
  std::vector<MethodSummary> methods;
};

std::string StudyTable(const std::vector<CellResult>& results);

// A header, then a line a cell and method. Lengths in mm, angles in deg, focal length in px; a figure that does not
// exist is empty.
std::string StudyCsv(const std::vector<CellResult>& results);

// One plot for each scene and everything else that varies but pixel noise: the hand-eye translation's error against
// it. None if pixel noise does not vary.
void WriteStudyPlots(const std::vector<CellResult>& results, const std::filesystem::path& folder);

// The same plots, and a row a cell and method, as a page.
std::string StudyPage(const std::string& title, const std::vector<CellResult>& results);

}  // namespace heba
