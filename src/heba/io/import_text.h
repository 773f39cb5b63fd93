// What readers of other projects' data sets share.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/geometry/rigid3.h"
#include "heba/io/import.h"

namespace heba {

// The numbers of a line, between blanks, commas, semicolons or tabs. InputError ("name:line: ...") for anything else.
std::vector<double> NumbersOfLine(std::string_view text, const std::filesystem::path& name, int line);

// A line that says something, without comments (#) and the blanks around it.
struct TextLine {
  std::string text;
  int number = 0;
};
std::vector<TextLine> LinesOf(const std::string& text);
// The numbers of all lines of a file. InputError as NumbersOfLine.
std::vector<double> NumbersOfFile(const std::filesystem::path& file);
// How many numbers the first line of a file has; 0 if it has anything else, or cannot be read. Does not throw.
size_t NumbersInFirstLine(const std::filesystem::path& file);
// The numbers of a list, and of the lists in it.
std::vector<double> FlatNumbers(const ConfigValue& value);

// A pose from numbers in one of the forms of pose_formats.def, or `where: ` and why it is none as an InputError.
Rigid3d PoseOf(std::string_view format, std::span<const double> numbers, const std::string& where);
// The same of a 4 x 4 matrix, row by row; `m_per_unit` for its translation.
Rigid3d PoseOfMatrix(std::span<const double> numbers, double m_per_unit, const std::string& where);
// {x, y, z, qx, qy, qz, qw} in metres. Other keys are passed over.
Rigid3d PoseOfMap(const ConfigValue& value);
// {translation: {x, y, z}, rotation: {x, y, z, w}}.
Rigid3d PoseOfTransform(const ConfigValue& value);

// The matrices of an OpenCV FileStorage file in YAML, by name: their numbers, row by row, and the plain numbers too.
std::map<std::string, std::vector<double>> FileStorageNumbers(const std::filesystem::path& path);

// The regular files of a folder whose names are one of `prefixes`, a whole number, one of `suffixes`, by that number.
// Of two kinds of names with one number the kind listed first; InputError if two of one kind have one number.
std::map<int, std::filesystem::path> NumberedFiles(const std::filesystem::path& folder,
                                                   std::initializer_list<std::string_view> prefixes,
                                                   std::initializer_list<std::string_view> suffixes);
// The pictures of a folder, in the order of the numbers in their names; none if there is no such folder.
std::vector<std::filesystem::path> ImagesOf(const std::filesystem::path& folder);
// The pictures of the first of `folders` that has any, one a pose. None, and a remark why, if there are not as many as
// poses.
std::vector<std::filesystem::path> ImagesForPoses(const std::vector<std::filesystem::path>& folders, size_t num_poses,
                                                  std::vector<std::string>* remarks);
// A capture with the name of its picture, or pose_N if it has none (an empty path, or none of that number).
ImportedCapture CaptureOf(const std::filesystem::path& picture, size_t number);
ImportedCapture CaptureOf(const std::map<int, std::filesystem::path>& pictures, int number);

// The first characters of a file, to tell what it is; empty if it cannot be read. Does not throw.
std::string BeginningOf(const std::filesystem::path& path);

// "chessboard" with its inner corners, as a target file.
std::string ChessboardYaml(int rows, int columns, double square_m);

}  // namespace heba
