// Reading of files up to a size limit, and writing that either completes or leaves nothing behind.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "heba/base/error.h"

namespace heba {

// Thrown if a file cannot be written for a reason that is not the user's mistake: a full disk, a quota, a broken
// device. The run itself has failed then, not its input.
class OutputError : public InputError {
 public:
  using InputError::InputError;
};

// Returns whether the file name has the suffix of an image format. The list includes formats that heba does not read,
// so that they can be refused with a clear message.
bool HasImageSuffix(const std::filesystem::path& path);

// Returns "; did you mean 'x'?" with the name of the file in the folder of `path` that is most like that of `path` and
// has the same numbers in it; empty if there is none.
std::string FileMeant(const std::filesystem::path& path);

// Returns the content of a file. Throws InputError if the file does not exist, is not a regular file (a folder, a pipe,
// a device), cannot be read or is larger than `max_bytes`.
std::string ReadTextFile(const std::filesystem::path& path, size_t max_bytes = size_t{64} << 20);

// Writes `content` to a temporary file, which has no name where the file system supports this, and then moves it to
// `path`. `path` is never seen half written, and nothing is left behind. Throws OutputError if the disk is full or
// broken. Throws InputError if the folder does not exist or cannot be written to, or if a link, a device or anything
// else than a regular file exists at `path`.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// Returns 16 unpredictable hexadecimal digits, for the name of a temporary file or folder.
std::string RandomName();

}  // namespace heba
