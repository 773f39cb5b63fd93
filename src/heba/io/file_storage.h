// OpenCV's cv::FileStorage, in YAML or JSON.
#pragma once

#include <filesystem>
#include <string>

#include "heba/config/yaml_reader.h"

namespace heba {

// Returns whether a file looks like the output of cv::FileStorage; XML is recognised too.
bool IsFileStorage(const std::string& text);

// Parses the text like ParseYaml, which does not accept the first line that OpenCV writes. Throws InputError for XML.
ConfigValue ParseFileStorage(const std::string& text, const std::filesystem::path& name);

}  // namespace heba
