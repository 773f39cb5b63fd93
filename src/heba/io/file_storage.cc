#include "heba/io/file_storage.h"

#include <algorithm>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {
namespace {

bool IsXml(const std::string& text) {
  return text.find("<opencv_storage") != std::string::npos || Trim(text.substr(0, 100)).starts_with("<?xml");
}

}  // namespace

bool IsFileStorage(const std::string& text) {
  return IsXml(text) || Trim(text.substr(0, 100)).starts_with("%YAML:1.0") ||
         text.find("opencv-matrix") != std::string::npos;
}

ConfigValue ParseFileStorage(const std::string& text, const std::filesystem::path& name) {
  if (IsXml(text)) {
    throw InputError(
        name.string() +
        ": is XML, which heba does not read; save it as .yml (cv::FileStorage chooses the format by the suffix)");
  }
  // The first line, %YAML:1.0, is not valid YAML. Its text is removed, but its line end is kept, so that line numbers
  // in messages stay correct.
  std::string document = text;
  const size_t directive = document.find("%YAML");
  if (directive != std::string::npos && Trim(document.substr(0, directive)).size() <= 3) {
    document.erase(0, std::min(document.find('\n', directive), document.size()));
  }
  return ParseYaml(document, name);
}

}  // namespace heba
