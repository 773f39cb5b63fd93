// A sheet of a target is printed from the target's file or keys.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "targets/render/sheet.h"

namespace heba {

struct TargetSheet {
  Sheet sheet;
  std::filesystem::path points_file;  // The positions of the points on the sheet.
  std::vector<std::string> warnings;  // Sentences about several pages and symmetries.
};

// Writes the sheet of a target, as .svg, .pdf or .png by the ending of `path`, and beside it, as .json, the positions
// of its points. `target` is the path of the target's file, or its keys as YAML in braces. The options' title and
// config are those of the target. Throws InputError for a target or a path that cannot be used, and if the sheet or its
// points would replace the target's file or a file of another kind.
TargetSheet WriteTargetSheet(const std::string& target, SheetOptions options, const std::filesystem::path& path);

// Returns a size, such as "210 x 297 mm".
std::string ShownSizeMm(const Eigen::Vector2d& size_mm);

}  // namespace heba
