// The command line: selects the command, parses its flags, and converts a failure into one line and an exit status.
#pragma once

#include <string>
#include <vector>

namespace heba {

// Runs `heba COMMAND [ARGUMENTS] [--flags]` and returns the exit status of the program.
int RunCommandLine(int argc, char** argv);

}  // namespace heba
