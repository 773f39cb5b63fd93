// Poses in files that no header describes: in the records of any nesting (heba/io/record_tree.h), and in the text of
// robots' programs (heba/io/pose_syntaxes.def). They are found by the shape of their numbers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

// The paths to the poses of a file and to the names of their images, such as records[].robot_coords and
// records[].image.
// `[]` stands for each item of a list, and `*` for each member of an object, whose key may be the name of the image. In
// a folder with one file per pose, the path is that within a file. Both are empty if the file leaves no choice.
struct RecordPaths {
  std::string pose;
  std::string image;
};

// The poses of one place, in the order of the file. A pose has 6, 7, 12 or 16 numbers: position and rotation in the
// order of the file, but the position first where the file's keys tell the two apart. 16 are a 4 x 4 matrix by rows,
// whether it was stored by rows, by columns or without its last row; 12 are a position and the rotation matrix by rows.
struct PoseRecords {
  RecordPaths paths;
  std::string pose_format = {};           // Name in pose_formats.def if the program is known that wrote them.
  std::vector<std::string> columns = {};  // The file's names of the numbers; empty if it has none.
  std::vector<std::vector<double>> rows = {};
  std::vector<std::string> images = {};  // Empty if no names stand beside the poses.
  std::vector<int> lines = {};           // The line of each pose; empty for records.
};

// Returns all places of a file, or of a folder with one file per pose, that have at least `fewest` poses. Throws
// InputError if a file cannot be read, and with its line if a pose in a robot's program breaks off.
std::vector<PoseRecords> FindPoseRecords(const std::filesystem::path& source, size_t fewest = 3);

}  // namespace heba
