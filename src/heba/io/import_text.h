// Common functions of the readers of other projects' data sets.
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

// Returns the numbers of a line, separated by blanks, tabs, commas or semicolons. Throws InputError ("name:line: ...")
// if the line contains anything else.
std::vector<double> NumbersOfLine(std::string_view text, const std::filesystem::path& name, int line);

// A non-empty line, without its comment (#) and the blanks around it.
struct TextLine {
  std::string text;
  int number = 0;
};
std::vector<TextLine> LinesOf(const std::string& text);
// Returns the numbers of all lines of a file. Throws InputError like NumbersOfLine.
std::vector<double> NumbersOfFile(const std::filesystem::path& file);
// Returns how many numbers the first line of a file contains; 0 if it contains anything else or cannot be read. Does
// not throw.
size_t NumbersInFirstLine(const std::filesystem::path& file);
// Returns the numbers of a list, including those of the lists in it.
std::vector<double> FlatNumbers(const ConfigValue& value);

// Returns a pose from numbers in one of the formats of pose_formats.def. Throws an InputError that begins with `where`
// if the numbers are not a pose.
Rigid3d PoseOf(std::string_view format, std::span<const double> numbers, const std::string& where);
// Returns a pose from a 4 x 4 matrix, row by row. The translation is multiplied by `m_per_unit`.
Rigid3d PoseOfMatrix(std::span<const double> numbers, double m_per_unit, const std::string& where);
// Reads {x, y, z, qx, qy, qz, qw}, in metres. Other keys are ignored.
Rigid3d PoseOfMap(const ConfigValue& value);
// Reads {translation: {x, y, z}, rotation: {x, y, z, w}}, in metres.
Rigid3d PoseOfTransform(const ConfigValue& value);

// Returns the matrices of an OpenCV FileStorage file in YAML, by name, as their numbers row by row. Scalar numbers are
// returned as well.
std::map<std::string, std::vector<double>> FileStorageNumbers(const std::filesystem::path& path);

// Returns the regular files of a folder whose names consist of one of `prefixes`, a whole number and one of `suffixes`,
// by this number. If names of several kinds have the same number, the kind listed first is used. Throws InputError if
// two files of one kind have the same number.
std::map<int, std::filesystem::path> NumberedFiles(const std::filesystem::path& folder,
                                                   std::initializer_list<std::string_view> prefixes,
                                                   std::initializer_list<std::string_view> suffixes);
// Returns the images of a folder, in the order of the numbers in their names; empty if there is no such folder.
std::vector<std::filesystem::path> ImagesOf(const std::filesystem::path& folder);
// A part of the data, and remarks for the user on how it was interpreted.
template <class Part>
struct Remarked {
  Part part;
  std::vector<std::string> remarks = {};
};
// Returns the images of the first of `folders` that contains any, one per pose. The function returns no images and a
// remark that says so if their number differs from the number of poses.
Remarked<std::vector<std::filesystem::path>> ImagesForPoses(const std::vector<std::filesystem::path>& folders,
                                                            size_t num_poses);
// Returns a capture with the name of its image, or pose_N if it has none (an empty path, or no image of that number).
ImportedCapture CaptureOf(const std::filesystem::path& image, size_t number);
ImportedCapture CaptureOf(const std::map<int, std::filesystem::path>& images, int number);

// Returns the first characters of a file, from which its format is recognised; empty if it cannot be read. Does not
// throw.
std::string BeginningOf(const std::filesystem::path& path);

// Returns the target file of a chessboard. `rows` and `columns` count the inner corners.
std::string ChessboardYaml(int rows, int columns, double square_m);

}  // namespace heba
