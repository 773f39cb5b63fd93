// The command line: which command, which flags, and how a failure becomes one line and an exit status.
#pragma once

#include <string>
#include <vector>

namespace heba {

enum ExitStatus { kDone = 0, kWorkFailed = 1, kInputWrong = 2 };

// Runs `heba COMMAND [ARGUMENTS] [--flags]`; the exit status of the program.
int RunCommandLine(int argc, char** argv);

// "heba: error: " and `message` made one line, on standard error.
void PrintError(const std::string& message);

}  // namespace heba
