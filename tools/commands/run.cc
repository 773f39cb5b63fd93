#include <iostream>

#include "heba/base/error.h"
#include "tools/command.h"
#include "tools/console.h"
#include "tools/flags.h"
#include "tools/pipeline.h"
#include "tools/result_table.h"

namespace heba {
namespace {

// One run: what happened, as an exit status; errors are printed.
int RunOne(const std::string& config_path, bool one_of_many) {
  Console console(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  try {
    const RunConfig config = ReadRunConfig(config_path, Settings());
    std::filesystem::path output = config.output;
    if (!FLAGS_out.empty()) {
      output = std::filesystem::absolute(FLAGS_out);
      if (one_of_many) output /= config.name;
    }
    const Outcome<RunResult> result = RunPipeline(config, output, NumThreads(), &console);
    if (!result) {
      PrintError(config_path + ": " + result.reason());
      return kWorkFailed;
    }
    if (!FLAGS_quiet) {
      std::cout << ResultTable(*result, UseColour() ? Colour::kAnsi : Colour::kPlain) << "results: " << output.string()
                << std::endl;
    }
    return kDone;
  } catch (const InputError& error) {
    PrintError(error.what());
    return kInputWrong;
  }
}

}  // namespace

int RunCommand_run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 1) return RunOne(arguments[0], false);
  // A run that fails fails alone; the batch then has failed.
  int status = kDone;
  for (const std::string& config : arguments) {
    if (RunOne(config, true) != kDone) status = kWorkFailed;
  }
  return status;
}

}  // namespace heba
