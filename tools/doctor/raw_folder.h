// Finds images and robot poses in a folder of unknown form, such as a user has after recording.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/pose_formats.h"

namespace heba {

struct RawFolder {
  std::filesystem::path images;  // The folder that contains them: the folder itself or one in it.
  size_t num_images = 0;
  std::filesystem::path poses;  // A table, an array, or a folder with one file per pose.
  PoseFormat format;            // Guessed from the size of the numbers.
  std::optional<std::filesystem::path> camera;
  std::optional<std::filesystem::path> target;
};

// Examines a folder. Returns nothing if it has no images or no poses.
std::optional<RawFolder> FindRawFolder(const std::filesystem::path& folder);

// A config for a raw folder, and remarks for the user. ConfigOf returns the text to be written as `config` (paths in
// it are relative to that file), with the pose format and the setup under which robot and images agree best, if there
// is a target to detect. `target` takes precedence over a target file in the folder. Trial configs are written to
// `config` too.
struct RawConfig {
  std::string text;
  std::vector<std::string> remarks;
};
RawConfig ConfigOf(const RawFolder& raw, const std::optional<std::filesystem::path>& target,
                   const std::filesystem::path& config, int num_threads);

}  // namespace heba
