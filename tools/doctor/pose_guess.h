// Guesses the format of a poses file that nobody has described.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/pose_formats.h"
#include "heba/io/pose_records.h"
#include "tools/doctor/doctor.h"
#include "tools/text/console.h"

namespace heba {

// The formats that a table of poses allows, the most likely first; none if it is no such table.
struct GuessedTable {
  std::vector<PoseFormat> formats;
  size_t num_rows = 0;
  RecordPaths paths = {};  // The places of the poses in the file; empty if it leaves no choice.
};

// Guesses formats from the file, array or folder (heba/io/pose_source.h) alone: which of its columns are the numbers
// of the pose, 6 (a position and angles), 7 (a quaternion), 12 or 16 (a matrix), in which order position and rotation
// are stored, and, by the size of the numbers, the most likely units; or what the program writes that the file comes
// from. The convention of Euler angles cannot be determined from the file. There are several tables if the file holds
// poses in several places; those whose names say that a robot has them come first.
std::vector<GuessedTable> GuessTables(const std::filesystem::path& poses);
// Returns the first of them, or the one at `place`; empty if there is none.
GuessedTable GuessPoseFormats(const std::filesystem::path& poses, const std::string& place = "");

// Returns the setting (--set) that makes a config read its poses in this format.
std::string PoseFormatSetting(const PoseFormat& format);

// The format that can read a poses file which cannot be read as the config says.
struct GuessedReading {
  PoseFormat format;
  Diagnosis diagnosis;  // The diagnosis with the poses read in this format.
  bool fits = false;    // Whether the images confirm the format; otherwise it rests on the size of the numbers alone.
};

// Reads the config with the guessed format and, if the images indicate another one, with that. Returns nothing if the
// poses are no table of numbers, or if the config has further faults.
std::optional<GuessedReading> GuessReading(const std::filesystem::path& config,
                                           const std::vector<std::string>& settings, int num_threads,
                                           Verbosity verbosity, Examine examine = Examine::kInputsAndResult);

// Describes a format in words: "6 numbers per pose: x, y, z in mm and euler_zyx in deg".
std::string ReadingInWords(const PoseFormat& format);

}  // namespace heba
