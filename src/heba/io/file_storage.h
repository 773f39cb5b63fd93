// OpenCV's cv::FileStorage, in YAML or JSON.
#pragma once

#include <filesystem>
#include <string>

#include "heba/config/yaml_reader.h"

namespace heba {

// Whether a file looks as cv::FileStorage writes it, in XML too.
bool IsFileStorage(const std::string& text);

// As ParseYaml, which chokes on the first line that OpenCV writes. InputError for XML.
ConfigValue ParseFileStorage(const std::string& text, const std::filesystem::path& name);

}  // namespace heba
