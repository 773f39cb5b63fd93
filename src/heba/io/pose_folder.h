// Folders with one pose per file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace heba {

// Returns the files of a folder that contain one pose each, in the order of the numbers in their names.
std::vector<std::filesystem::path> PoseFilesOf(const std::filesystem::path& folder);

// Returns the last group of digits in a file's name without its suffix as a number, such as 7 for pose_0007; nothing if
// there is none.
std::optional<long> NumberInName(const std::string& stem);

}  // namespace heba
