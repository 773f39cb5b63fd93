// A study's finished cells, each in a file of its own: what was done is not done again.
#pragma once

#include <filesystem>
#include <optional>

#include "tools/study/study_report.h"

namespace heba {

// In a study's folder; made if needed. InputError if the folder holds other files than a study's.
class StudyCells {
 public:
  StudyCells(const std::filesystem::path& folder, const StudyConfig& study);

  // A cell that this very program has finished, of the same content and trials; nothing otherwise.
  std::optional<CellResult> Find(int cell) const;
  void Keep(const CellResult& result) const;

 private:
  std::filesystem::path FileOf(int cell) const;

  std::filesystem::path folder_;
  const StudyConfig& study_;
};

}  // namespace heba
