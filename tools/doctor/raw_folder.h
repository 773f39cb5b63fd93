// A folder of pictures and robot poses in no form that anybody has described: what a user has after a session.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/pose_formats.h"

namespace heba {

struct RawFolder {
  std::filesystem::path pictures;  // The folder that holds them: the folder itself or one in it.
  size_t num_images = 0;
  std::filesystem::path poses;  // A table, an array, or a folder with one file a pose.
  PoseFormat format;            // By the numbers' sizes.
  std::optional<std::filesystem::path> camera;
  std::optional<std::filesystem::path> target;
};

// Nothing if the folder has no pictures or no poses.
std::optional<RawFolder> FindRawFolder(const std::filesystem::path& folder);

// A config for it, to be written as `config` (paths in it are relative to that file), with the reading of the poses and
// the set-up under which robot and pictures agree best, where there is a target to look for; and what a person should
// know of that. `target` counts more than what lies in the folder.
struct RawConfig {
  std::string text;
  std::vector<std::string> remarks;
};
RawConfig ConfigOf(const RawFolder& raw, const std::optional<std::filesystem::path>& target,
                   const std::filesystem::path& config, int num_threads);

}  // namespace heba
