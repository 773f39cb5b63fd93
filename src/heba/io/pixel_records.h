// The pixels of a target's points in records of any nesting (heba/io/record_tree.h), as other detectors store them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// The points that one record holds, in the order of the file.
struct PixelRecord {
  std::string image;  // The file name of its image; empty if none is stated.
  std::vector<Eigen::Vector2d> pixels;
};

// Returns the points at a path such as records[].corners, one list for each record: `[]` stands for each item of a
// list,
// `[2]` for its third item, and `*` for each member of an object, whose key is then the name of the image. A list of
// points has two numbers a point, however they are nested (OpenCV's N x 1 x 2 too); u is the first. `image_path`, which
// may be empty, leads to the names of the images in the same way. A record whose value is null has no points.
//
// Throws InputError if the file cannot be read, if a path leads to nothing, if there are not as many names as lists, or
// if a list does not consist of pairs of finite numbers.
std::vector<PixelRecord> ReadPixelRecords(const std::filesystem::path& file, const std::string& pixel_path,
                                          const std::string& image_path);

}  // namespace heba
