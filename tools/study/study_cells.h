// Stores each finished cell of a study in a file of its own, so that an interrupted study can continue.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tools/study/study_rows.h"

namespace heba {

// Stores the cells in the folder of a study, which is created if needed. Throws InputError if the folder holds files
// other than those of a study, or cannot be created.
class StudyCells {
 public:
  StudyCells(const std::filesystem::path& folder, const StudyConfig& study);

  // Returns the results of a cell that the same build of the program has finished with the same content, trials and
  // seed; otherwise nothing.
  std::optional<std::vector<CellResult>> Find(int cell) const;
  // Stores the results of one cell.
  void Keep(const std::vector<CellResult>& results) const;

 private:
  std::filesystem::path FileOf(int cell) const;

  std::filesystem::path folder_;
  const StudyConfig& study_;
};

}  // namespace heba
