// Data sets in the formats of other projects. A format is selected by name or recognised from the files. A new format
// needs one file in import_formats/ and one line in import_formats.def.
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

// One image of a data set, with the data that the set contains for it.
struct ImportedCapture {
  std::string name;             // File name of the image, or a name made from its number.
  std::filesystem::path image;  // Empty if the data set has no images.
  std::optional<Rigid3d> base_from_gripper;
  // Detections of the other project: the pose of the target, or its points (id and pixel; (0, 0) is the centre of the
  // first pixel).
  std::optional<Rigid3d> camera_from_target;
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> pixels;
};

struct ImportedSet {
  std::string format;
  std::optional<Setup> setup;    // Empty if the files do not contain it.
  std::optional<Camera> camera;  // Its image size is 0 x 0 if the files do not contain it.
  std::string target;            // Target file (YAML); empty if the files do not describe the target.
  std::vector<ImportedCapture> captures;
  std::vector<std::filesystem::path> files;  // All files that were read, except the images.
  std::vector<std::string> remarks;          // Remarks for the user on how the data were interpreted.
};

// One camera of a rig.
struct ImportedCamera {
  std::string name;                          // Letters, digits, _ and -.
  std::optional<Camera> camera;              // With the size of its images.
  std::filesystem::path images;              // The folder with its images; empty if the data set has none.
  std::optional<Rigid3d> mount_from_camera;  // The true pose.
};

// The images that the cameras of a rig recorded at one pose of the arm.
struct ImportedCellCapture {
  Rigid3d base_from_gripper;
  std::vector<std::string> images;  // File names, one for each camera; empty for a camera without an image.
};

// A data set of several cameras, one arm and one target. It may consist of cameras alone.
struct ImportedCell {
  std::string format;
  std::optional<Setup> setup;  // That of all cameras; empty if the files do not contain it.
  std::vector<ImportedCamera> cameras;
  std::string target_name;
  std::string target;  // Target file (YAML); empty if the files do not describe the target.
  std::vector<ImportedCellCapture> captures;
  std::vector<std::filesystem::path> files;  // All files that were read, except the images.
  std::vector<std::string> remarks;          // Remarks for the user on how the data were interpreted.
};

// The functions that a file in import_formats/ provides. Both `read` functions convert the poses to the members'
// directions, in metres, and throw InputError on a fault.
struct ImportReader {
  // Returns whether a file or folder appears to have this format; it may still be faulty.
  bool (*matches)(const std::filesystem::path& source);
  // Reads a data set of one camera, or the first camera of several. Null if the format has no captures.
  ImportedSet (*read)(const std::filesystem::path& source);
  // Reads all cameras; nothing if the source has only one. Null if the format has one camera always.
  std::optional<ImportedCell> (*read_rig)(const std::filesystem::path& source) = nullptr;
};

struct ImportFormat {
  std::string_view name;
  std::string_view description;
  ImportReader reader;
};

// Returns all formats, in the order of import_formats.def.
const std::vector<ImportFormat>& ImportFormats();
std::vector<std::string> ImportFormatNames();
// Returns the names of the formats that ImportDataSet reads.
std::vector<std::string> DataSetFormatNames();

// Returns the first format that recognises a file or folder; null if none does.
const ImportFormat* FindImportFormat(const std::filesystem::path& source);

// Reads a file or folder. `format` is the name of a format, or empty to recognise it. Throws InputError if the format
// is unknown, or if the data set is faulty or contains no captures.
ImportedSet ImportDataSet(const std::filesystem::path& source, std::string_view format);

// Reads the file or folder of a rig likewise; nothing if it is a data set of one camera.
std::optional<ImportedCell> ImportCell(const std::filesystem::path& source, std::string_view format);

}  // namespace heba
