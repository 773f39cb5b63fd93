// Robot poses from wherever a user keeps them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/pose_file.h"

namespace heba {

// Reads
//   a table (pose_file.h),
//   an array of NumPy, a pose a row (N x the format's columns, or N x 4 x 4 for matrices),
//   a folder with one file a pose, by the numbers in their names: .txt and .csv with nothing but the numbers of one
//   pose
//     in the order of the format's columns, or a table of one row; .yaml and .json with the columns as keys, or with
//     a list of the numbers, or with a position and an orientation that are lists or mappings of x, y, z (and w), or an
//     OpenCV FileStorage with one matrix; .npy.
// A row of a folder has the file's name without its suffix as its image. InputError on the first fault, with its file.
std::vector<PoseRow> ReadPoses(const std::filesystem::path& path, const PoseFormat& format);

// The numbers of the one pose in a .yaml or .json file, by its keys. InputError as of ReadPoses.
std::vector<double> PoseNumbersOfYaml(const std::filesystem::path& file, const PoseFormat& format);

// The files of a folder that hold one pose each, in the order of the numbers in their names.
std::vector<std::filesystem::path> PoseFilesOf(const std::filesystem::path& folder);

// The last run of digits in a file's name without its suffix, as a number, such as 7 of pose_0007; nothing if there is
// none.
std::optional<long> NumberInName(const std::string& stem);

}  // namespace heba
