// The file poses.csv: the pose that the robot reported at every capture.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/data/capture_role.h"
#include "heba/io/pose_formats.h"

namespace heba {

struct PoseRow {
  std::string image;  // Empty if the file has no such column.
  CaptureRole role = CaptureRole::kNone;
  Rigid3d pose;                      // Pose between the frames of the file; the caller must know its direction.
  int line = 0;                      // Line of the file, from 1; 0 if the file has no lines.
  std::vector<double> numbers = {};  // The numbers of the file, in the order of the format's columns.
  // The numbers in the columns beside the pose; empty if the file has no such columns.
  std::vector<double> extras = {};
  // The images of the cameras that were asked for; empty if the file has no such columns, and an empty text for a
  // camera without an image.
  std::vector<std::string> images = {};
  std::optional<double> time_s = {};  // When it was; nothing if the file has no such column.
};

// Reads a table: a header line that names the columns (those of `format` and optionally `image`, `role` and `time`, in
// any order), then one line per capture.
//
// A file without a header is accepted if `format` is a user's own, whose file_columns name the columns, or if it has
// the joints of an arm, base first. Brackets around the lines of such a file ([[1, 2, 3], [4, 5, 6]], p[...]) are
// ignored. If a file with a header uses another name for its image column, the position of `image` in file_columns
// identifies it. Other columns are errors, unless file_columns contains `-`.
//
// A file with a header may also have the columns `extra_columns` of numbers, all or none of them, and a column
// `image.CAMERA` for each of `cameras`, all or none of them.
//
// Fields are separated by the most frequent one of commas, semicolons and tabs in the first line, or by blanks if it
// has none of them, and may be quoted. Where commas do not separate the fields, they may be decimal commas. Blank lines
// and lines that start with # are skipped. Throws InputError with the line and column of the first fault, and also for
// a file over 64 MiB, for more than a million captures, and for none.
std::vector<PoseRow> ReadPoseFile(const std::filesystem::path& path, const PoseFormat& format,
                                  const std::vector<std::string>& extra_columns = {},
                                  const std::vector<std::string>& cameras = {});
// Parses text; `name` is the name of the file in messages.
std::vector<PoseRow> ParsePoses(const std::string& text, const std::filesystem::path& name, const PoseFormat& format,
                                const std::vector<std::string>& extra_columns = {},
                                const std::vector<std::string>& cameras = {});

// Returns a time that is stated in s or, if it is too large for that, in ms, us or ns since the year 1970, in s.
double SecondsOf(double time);

// Returns the text of a number with a point in place of its decimal comma; any other text unchanged.
std::string WithDecimalPoint(std::string text);

// Returns a line such as [[1, 2, 3], [4, 5, 6]] or p[1, 2, 3, 4, 5, 6] without brackets, comment and trailing
// separators.
std::string WithoutBrackets(std::string_view line);

// Returns the text of such a file, with full precision. Columns that are empty in all rows are left out,
// and times unless every row has one. Every row must
// have numbers for `extra_columns`, and an image or an empty text for each of `cameras`.
std::string PoseFileText(const std::vector<PoseRow>& rows, const PoseFormat& format,
                         const std::vector<std::string>& extra_columns = {},
                         const std::vector<std::string>& cameras = {});

}  // namespace heba
