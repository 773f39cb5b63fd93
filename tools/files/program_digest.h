// The digest of this program.
#pragma once

#include <string>

namespace heba {

// Returns the digest (tools/run/digest.h) of this program and of the shared libraries that it runs with, so that the
// results of another build are not reused.
const std::string& DigestOfProgram();

}  // namespace heba
