// Finds images and robot poses in a folder of unknown form, such as a user has after recording.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/setup.h"
#include "heba/io/pose_formats.h"

namespace heba {

struct RawFolder {
  std::filesystem::path images;  // The folder that contains them: the folder itself or one in it.
  size_t num_images = 0;
  std::filesystem::path poses;  // A table, an array, or a folder with one file per pose.
  PoseFormat format;            // Guessed from the size of the numbers.
  std::optional<std::filesystem::path> camera;
  std::optional<std::filesystem::path> target;
  std::optional<Setup> setup;  // If the user states it.
  // Why a file that looks like a table of poses cannot be read; empty if there is none, or if poses were found.
  std::string poses_fault;
};

// Examines a folder for everything that is not `given`. What it does not find stays empty.
RawFolder FindRawFiles(const std::filesystem::path& folder, const RawFolder& given);

// Examines a folder. Returns nothing if it has no images or no poses. Throws InputError if its poses cannot be read.
std::optional<RawFolder> FindRawFolder(const std::filesystem::path& folder);

// A config for a raw folder, with warnings and remarks for the user, which are comments in it too. ConfigOf returns the
// text to be written as `config` (paths in it are relative to that file), with the pose format and the setup under
// which robot and images agree best, if there is a target to detect.
struct RawConfig {
  std::string text;
  std::vector<std::string> warnings;  // Faults of the data set or of the given target; they come first.
  std::vector<std::string> remarks;
  // Whether robot and images agree under the setup and the pose format of the config, perhaps with another target.
  bool fits = false;
  std::optional<Setup> setup;  // The setup of the config; nothing if it is left open.
};
RawConfig ConfigOf(const RawFolder& raw, const std::filesystem::path& config, int num_threads);

// Returns the warnings and remarks as lines for the user, such as "warning: ...".
std::string RemarksText(const RawConfig& made);

}  // namespace heba
