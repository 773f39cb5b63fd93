// Data sets as other projects keep them. A form of them is found by name in a table or by what the files look like; a
// new one is one file in import_formats/ and one line of import_formats.def.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/camera/camera.h"
#include "heba/data/setup.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct ImportedCapture {
  std::string name;             // The picture's, or one that is made up from its number.
  std::filesystem::path image;  // Empty if the set has no pictures.
  std::optional<Rigid3d> base_from_gripper;
  // What others found in the picture: the target's pose, or its points (id and pixel, (0, 0) the centre of the first).
  std::optional<Rigid3d> camera_from_target;
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> pixels;
};

struct ImportedSet {
  std::string format;
  std::optional<Setup> setup;    // Nothing: the files do not say.
  std::optional<Camera> camera;  // Its size is 0 x 0 if the files do not tell it.
  std::string target;            // As a target file (YAML); empty if the files do not tell.
  std::vector<ImportedCapture> captures;
  std::vector<std::filesystem::path> files;  // All that was read, pictures excepted.
  std::vector<std::string> remarks;          // What a person should know of how it was read.
};

// What a file in import_formats/ brings.
struct ImportReader {
  // Whether a file or folder is meant to be of this form; it may still be faulty.
  bool (*matches)(const std::filesystem::path& source);
  // Poses become base_from_gripper and camera_from_target in metres. InputError on a fault.
  ImportedSet (*read)(const std::filesystem::path& source);
};

struct ImportFormat {
  std::string_view name;
  std::string_view description;
  ImportReader reader;
};

// In the order of import_formats.def.
const std::vector<ImportFormat>& ImportFormats();
std::vector<std::string> ImportFormatNames();

// The first format that takes a file or folder for its own; null if none does.
const ImportFormat* FindImportFormat(const std::filesystem::path& source);

// Reads a file or folder; `format` is a name of the table, or empty to find it out. InputError if it is of no known
// form, is faulty, or holds no captures.
ImportedSet ImportDataSet(const std::filesystem::path& source, std::string_view format);

}  // namespace heba
