// Finds images and robot poses in a folder of unknown form, such as a user has after recording.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/setup.h"
#include "heba/io/pose_formats.h"
#include "heba/io/pose_records.h"

namespace heba {

// Poses that a file or folder may hold.
struct RawPoses {
  std::filesystem::path source;  // A table, an array, records, a robot's program, or a folder with one file per pose.
  RecordPaths paths = {};        // Their places in it; empty if it leaves no choice.
  PoseFormat format;             // Guessed from the size of the numbers.
  size_t num_rows = 0;
};

struct RawFolder {
  std::filesystem::path images;  // The folder that contains them: the folder itself or one in it.
  size_t num_images = 0;
  std::filesystem::path poses;  // The poses that the user states; empty if they are to be found.
  std::vector<RawPoses> found;  // The likeliest poses first: those with as many rows as there are images.
  std::optional<std::filesystem::path> camera;
  std::optional<std::filesystem::path> target;
  std::optional<Setup> setup;  // If the user states it.
};

// Examines a folder for everything that is not `given`. What it does not find stays empty.
RawFolder FindRawFiles(const std::filesystem::path& folder, const RawFolder& given);

// Examines a folder. Returns nothing if it has no images or no poses.
std::optional<RawFolder> FindRawFolder(const std::filesystem::path& folder);

// A config for a raw folder, with warnings and remarks for the user, which are comments in it too. ConfigOf returns the
// text to be written as `config` (paths in it are relative to that file), with the poses, the pose format and the setup
// under which robot and images agree best, if there is a target to detect. It reads that text again and examines it: if
// the fit that was found does not come out, it throws an InputError with both readings.
struct RawConfig {
  std::string text;
  std::vector<std::string> warnings;  // Faults of the data set or of the given target; they come first.
  std::vector<std::string> remarks;
  // Whether robot and images agree under the setup and the pose format of the config, perhaps with another target.
  bool fits = false;
  std::optional<Setup> setup;         // The setup of the config; nothing if it is left open.
  std::filesystem::path poses;        // The poses that the config names.
  std::filesystem::path target = {};  // The target's file, if it was written for this config.
};
RawConfig ConfigOf(const RawFolder& raw, const std::filesystem::path& config, int num_threads);

// Likewise for a folder that is a data set of another project (heba/io/import.h) with images and robot poses of one
// camera: the config names it (captures.data). `raw` holds what the user states. Returns nothing if the folder is no
// such data set.
std::optional<RawConfig> ConfigOfDataSet(const std::filesystem::path& folder, const RawFolder& raw,
                                         const std::filesystem::path& config, int num_threads);

// Returns the warnings and remarks as lines for the user, such as "warning: ...".
std::string RemarksText(const RawConfig& made);

}  // namespace heba
