// Computes digests of contents. Equal contents have equal digests; different contents have different ones, except with
// a probability of 1e-30. Digests protect against accidents, not against malice.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace heba {

// Returns a digest of 32 hexadecimal digits.
std::string DigestOf(std::string_view content);
// Throws InputError if the file cannot be read.
std::string DigestOfFile(const std::filesystem::path& path);
}  // namespace heba
