// The files that `heba import` writes from a data set of another project.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "heba/io/import.h"

namespace heba {

// The contents of all files, complete before the first is written.
struct ImportedFiles {
  std::vector<std::pair<std::string, std::string>> files;  // Name and text.
  std::string config;
};

// Returns the files of a data set with a config that names them. Images stay where they are: the config has their paths
// relative to `output`, the folder that the files are for. What the data set lacks is a comment of the config. Throws
// InputError if the first image, from which the size of a camera may have to be taken, cannot be read.
ImportedFiles FilesOf(const ImportedSet& set, const std::filesystem::path& output);
ImportedFiles FilesOf(const ImportedCell& rig, const std::filesystem::path& output);

}  // namespace heba
