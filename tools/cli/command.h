// The command line: which command, which flags, and how a failure becomes one line and an exit status.
#pragma once

#include <string>
#include <vector>

namespace heba {

// Runs `heba COMMAND [ARGUMENTS] [--flags]`; the exit status of the program.
int RunCommandLine(int argc, char** argv);

}  // namespace heba
