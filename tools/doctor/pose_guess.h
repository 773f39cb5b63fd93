// Guesses what the numbers of a poses file mean that nobody has described.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/pose_formats.h"
#include "tools/doctor/doctor.h"
#include "tools/text/console.h"

namespace heba {

// The readings that a table of poses allows, the likelier one first; none if it is no such table.
struct GuessedTable {
  std::vector<PoseFormat> formats;
  size_t num_rows = 0;
};

// Guesses from the file, array or folder (heba/io/pose_source.h) alone: which of its columns are the pose's numbers, 6
// (a place and angles), 7 (a quaternion), 12 or 16 (a matrix), in which order place and rotation stand, and, by the
// numbers' size, the likeliest units. Orders of angles cannot be told from it.
GuessedTable GuessPoseFormats(const std::filesystem::path& poses);

// The setting (--set) that makes a config read its poses so.
std::string PoseFormatSetting(const PoseFormat& format);

// A config whose poses file cannot be read as it says, and the reading that can.
struct GuessedReading {
  PoseFormat format;
  Diagnosis diagnosis;  // With the poses read so.
  bool fits = false;    // Whether the pictures agree; otherwise the numbers' sizes alone speak for it.
};

// Reads the config with the guessed format and, where the pictures tell another one, with that. Nothing if the poses
// are no table of numbers, or the config has further faults.
std::optional<GuessedReading> GuessReading(const std::filesystem::path& config,
                                           const std::vector<std::string>& settings, int num_threads,
                                           Verbosity verbosity);

// "6 numbers a pose: x, y, z in mm and euler_zyx in deg".
std::string ReadingInWords(const PoseFormat& format);

}  // namespace heba
