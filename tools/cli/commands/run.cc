#include <iostream>

#include "heba/base/error.h"
#include "tools/batch/batch.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/pipeline/pipeline.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_table.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

std::string TableOf(const RunResult& result, const RunConfig& config) {
  // A method that the config names is one that the user expects.
  std::vector<std::string> asked_for = config.options.methods;
  asked_for.push_back(config.options.seed);
  return ResultTable(result, UseColour() ? Colour::kAnsi : Colour::kPlain, asked_for);
}

int RunOne(const std::string& config_path, const RunDemands& demands) {
  const RunConfig config = ReadRunConfig(config_path, Settings());
  const std::filesystem::path output = FLAGS_out.empty() ? config.output : std::filesystem::absolute(FLAGS_out);
  Console console(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  const std::optional<RunResult> current = FLAGS_resume ? CurrentResult(output, config) : std::nullopt;
  if (current) console.Note(config.data.name + ": the inputs have not changed since these results");
  const Outcome<RunResult> result =
      current ? Outcome<RunResult>(*current) : RunPipeline(config, output, NumThreads(), &console);
  if (!result) {
    PrintError(config_path + ": " + FailureText(result.failure()));
    return kWorkFailed;
  }
  if (!FLAGS_quiet) {
    std::cout << ForTerminal(TableOf(*result, config)) << "results: " << output.string() << std::endl;
  }
  if (const std::string not_met = WhyNotMet(*result, demands); !not_met.empty()) {
    PrintError(config_path + ": " + not_met);
    return kWorkFailed;
  }
  return kDone;
}

}  // namespace

int RunCommand_run(const std::vector<std::string>& arguments) {
  const Shard shard = ParseShard();
  const RunDemands demands = {FailOn(), FLAGS_strict};
  // An explicit --shard requests a batch, even a shard 0/1 of a single config.
  if (arguments.size() == 1 && FLAGS_shard.empty()) return RunOne(arguments[0], demands);
  BatchOptions options;
  if (!FLAGS_out.empty()) options.output = std::filesystem::absolute(FLAGS_out).lexically_normal();
  options.settings = Settings();
  options.num_threads = NumThreads();
  options.resume = FLAGS_resume;
  options.shard = shard;
  options.demands = demands;
  options.verbosity = FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal;
  return RunBatch(arguments, options);
}

}  // namespace heba
