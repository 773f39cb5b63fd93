// Tells files of heba that are mistaken for one another.
#pragma once

#include <filesystem>

#include "heba/config/yaml_reader.h"

namespace heba {

enum class FileKind { kRunConfig, kScene, kStudy, kTarget, kCamera };

// Throws InputError if a file of this kind is needed and `path` is a folder; the message names the file in it that may
// be meant.
void RefuseFolder(const std::filesystem::path& path, FileKind kind);

// Throws InputError if the keys of `value`, the contents of `path`, are those of another kind of file; the message
// names the command for that kind. A file that is of no kind is left to its reader.
void RefuseOtherKind(const ConfigValue& value, const std::filesystem::path& path, FileKind kind);

}  // namespace heba
