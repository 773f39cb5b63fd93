// Files, read within limits and written whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "heba/base/error.h"

namespace heba {

// A file that cannot be written for no fault of the command line's: a full disk, a quota, a broken device. The work
// failed.
class OutputError : public InputError {
 public:
  using InputError::InputError;
};

// Whether a file name has the suffix of a picture, of a format that heba reads or of one that it refuses in words.
bool HasImageSuffix(const std::filesystem::path& path);

// The whole file. InputError if it is missing, no regular file (a folder, a pipe, a device), unreadable or larger than
// `max_bytes`.
std::string ReadTextFile(const std::filesystem::path& path, size_t max_bytes = size_t{64} << 20);

// Writes `content` to a file without a name and then gives it `path`, so that `path` is never seen half written and
// nothing is left behind. OutputError if the disk is full or broken, InputError if the folder does not exist or cannot
// be written, or if a link, a device or another thing than a regular file stands at `path`.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// Returns 16 hexadecimal digits that nobody foretells, for the name of a temporary file or folder.
std::string RandomName();

}  // namespace heba
