// Short names of contents: equal contents have equal digests, and different ones, but for one chance in 1e30, do not.
// Against accidents, not against malice.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace heba {

// 32 hexadecimal digits.
std::string DigestOf(std::string_view content);
// InputError if the file cannot be read.
std::string DigestOfFile(const std::filesystem::path& path);
// Of this very program and the libraries that it runs with: what another build found is not taken over.
const std::string& DigestOfProgram();

}  // namespace heba
