// The digest of this program.
#pragma once

#include <filesystem>
#include <string>

namespace heba {

// Returns the digest (tools/run/digest.h) of this program and of the shared libraries that it runs with, so that the
// results of another build are not reused.
const std::string& DigestOfProgram();

// Returns the digest of the program of a process, given its folder in /proc. If /proc is not mounted, it is that of the
// version and the commit, which does not distinguish builds of a changed source.
std::string DigestOfProcess(const std::filesystem::path& process);

}  // namespace heba
