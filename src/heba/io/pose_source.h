// Robot poses from the usual kinds of files and folders.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/io/pose_file.h"
#include "heba/io/pose_records.h"

namespace heba {

// Reads robot poses from
//   - a table (pose_file.h);
//   - a NumPy array with one pose per row (N x the format's columns, or N x 4 x 4 for matrices);
//   - a folder with one file per pose, in the order of the numbers in the file names:
//       .txt and .csv: only the numbers of one pose in the order of the format's columns, or a table of one row;
//       .yaml and .json: the columns as keys, a list of the numbers, a position and an orientation that are lists or
//       mappings of x, y, z (and w), or an OpenCV FileStorage with one matrix;
//       .npy: an array with the numbers of one pose;
//   - records and robots' programs (pose_records.h): where `paths` says, or if the source is none of the above, at the
//     one place whose poses have as many numbers as the format.
// The image of a row that was read from a folder is the file's name without its suffix. Throws InputError with the file
// of the first fault.
// `cameras`: ReadPoseFile, for tables.
std::vector<PoseRow> ReadPoses(const std::filesystem::path& path, const PoseFormat& format,
                               const std::vector<std::string>& cameras = {}, const RecordPaths& paths = {});

// Returns the numbers of the one pose in a .yaml or .json file, by its keys. Throws InputError like ReadPoses.
std::vector<double> PoseNumbersOfYaml(const std::filesystem::path& file, const PoseFormat& format);

}  // namespace heba
