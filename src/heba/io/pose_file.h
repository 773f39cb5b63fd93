// poses.csv: what the robot said at every capture.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "heba/io/pose_formats.h"

namespace heba {

// What a capture can be to the two-step method.
inline constexpr std::string_view kCaptureRoles[] = {"home", "translate_x", "translate_y", "rotate", "free"};

struct PoseRow {
  std::string image;                 // Empty if the file has no such column.
  std::string role;                  // One of kCaptureRoles; empty if there is none.
  Rigid3d pose;                      // Between the frames that the file has: which way round is the caller's to know.
  int line = 0;                      // In the file, from 1; 0 if the file has no lines.
  std::vector<double> numbers = {};  // As the file has them, in the order of the format's columns.
};

// A header line that names the columns (those of `format`, and `image` and `role` if wanted, in any order), then a line
// a capture. A file without a header is read where `format` is a user's own, whose file_columns say what its columns
// are; brackets around its lines ([[1, 2, 3], [4, 5, 6]], p[...]) are passed over. A file with a header may call its
// column of pictures otherwise: then it is the one where file_columns have image. Fields are separated by commas,
// semicolons or tabs, whichever the first line has most of, or else by blanks, and may be quoted; blank lines and lines
// that start with # are skipped. InputError on the first fault, with its line and column; for a file over 64 MiB or of
// more than a million captures, and for one without any.
std::vector<PoseRow> ReadPoseFile(const std::filesystem::path& path, const PoseFormat& format);
// The same from text; `name` is what messages call it.
std::vector<PoseRow> ParsePoses(const std::string& text, const std::filesystem::path& name, const PoseFormat& format);

// A line as [[1, 2, 3], [4, 5, 6]], or p[1, 2, 3, 4, 5, 6] writes it, without brackets, comments and what ends it.
std::string WithoutBrackets(std::string_view line);

// The text of such a file, to full precision. Columns that no row fills are left out.
std::string PoseFileText(const std::vector<PoseRow>& rows, const PoseFormat& format);

}  // namespace heba
