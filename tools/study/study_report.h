// Reports a finished study for people and programs: a terminal table, study.csv, plots and study.html.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/config/study_config.h"

namespace heba {

// The result of a cell with one camera, or of one pose of a rig's cell. The results of one cell are neighbours.
struct CellResult {
  int cell = 0;  // Index of the cell in the study.
  StudyLabels labels;
  Outcome<StudyErrors> bound = {};
  std::vector<MethodSummary> methods;
};

std::string StudyTable(const std::vector<CellResult>& results);

// Returns a header and one line for each cell, pose and method. Lengths are in mm, angles in deg, focal lengths in px;
// a missing figure is empty. The columns of the hand-eye pose are those of the column `pose`.
std::string StudyCsv(const std::vector<CellResult>& results);

// Writes the RMS error of the hand-eye translation, or of the translation of each pose of a rig, against the pixel
// noise, one SVG file for each combination of scene, pose and other varied quantities. Writes nothing if the pixel
// noise does not vary.
void WriteStudyPlots(const std::vector<CellResult>& results, const std::filesystem::path& folder);

// Returns a page with plots of every varied quantity and a table row for each cell and method.
std::string StudyPage(const std::string& title, const std::vector<CellResult>& results);

}  // namespace heba
