// Stores each finished cell of a study in a file of its own, so that an interrupted study can continue.
#pragma once

#include <filesystem>
#include <optional>

#include "tools/study/study_report.h"

namespace heba {

// Stores the cells in the folder of a study, which is created if needed. Throws InputError if the folder holds files
// other than those of a study, or cannot be created.
class StudyCells {
 public:
  StudyCells(const std::filesystem::path& folder, const StudyConfig& study);

  // Returns a cell that the same build of the program has finished with the same content, trials and seed; otherwise
  // nothing.
  std::optional<CellResult> Find(int cell) const;
  void Keep(const CellResult& result) const;

 private:
  std::filesystem::path FileOf(int cell) const;

  std::filesystem::path folder_;
  const StudyConfig& study_;
};

}  // namespace heba
