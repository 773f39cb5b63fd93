// The history of the checks of a cell: a file that grows, and its page.
#pragma once

#include <filesystem>
#include <string>

#include "heba/data/problem.h"
#include "heba/session_check.h"

namespace heba {

// Adds a check, made now, to history.json in a folder, which is created if it is not there, and writes history.html: a
// line for each check and a chart of the changes against the smallest that would have been seen. Throws InputError if
// the folder cannot be made or history.json is no such file, OutputError if it cannot be written.
void AddToHistory(const std::filesystem::path& folder, const std::string& run, const Problem& rig,
                  const SessionCheck& check);

}  // namespace heba
