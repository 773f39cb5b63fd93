#include <iostream>

#include "heba/base/error.h"
#include "tools/batch/batch.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/pipeline/pipeline.h"
#include "tools/pipeline/run_inputs.h"
#include "tools/text/console.h"
#include "tools/text/result_table.h"
#include "tools/text/result_text.h"
#include "tools/text/rig_table.h"

namespace heba {
namespace {

// Ends a run: prints the table, and returns the exit status.
int Finish(const std::string& config_path, const std::string& table, const std::filesystem::path& output,
           const Verdict& verdict, std::optional<Grade> fail_on) {
  if (!FLAGS_quiet) std::cout << ForTerminal(table) << "results: " << output.string() << std::endl;
  if (fail_on && verdict.grade >= *fail_on) {
    PrintError(config_path + ": " + VerdictFailure(verdict));
    return kWorkFailed;
  }
  return kDone;
}

int RunOneRig(const std::string& config_path, std::optional<Grade> fail_on) {
  const RigConfig config = ReadRigConfig(config_path, Settings());
  const std::filesystem::path output = FLAGS_out.empty() ? config.output : std::filesystem::absolute(FLAGS_out);
  Console console(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  const std::optional<RigResult> current = FLAGS_resume ? CurrentResult(output, config) : std::nullopt;
  if (current) console.Note(config.data.name + ": the inputs have not changed since these results");
  const Outcome<RigResult> result =
      current ? Outcome<RigResult>(*current) : RunPipeline(config, output, NumThreads(), &console);
  if (!result) {
    PrintError(config_path + ": " + result.reason());
    return kWorkFailed;
  }
  return Finish(config_path, RigTable(*result, UseColour() ? Colour::kAnsi : Colour::kPlain), output, result->verdict,
                fail_on);
}

int RunOne(const std::string& config_path, std::optional<Grade> fail_on) {
  if (IsRigConfig(config_path, Settings())) return RunOneRig(config_path, fail_on);
  const RunConfig config = ReadRunConfig(config_path, Settings());
  const std::filesystem::path output = FLAGS_out.empty() ? config.output : std::filesystem::absolute(FLAGS_out);
  Console console(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  const std::optional<RunResult> current = FLAGS_resume ? CurrentResult(output, config) : std::nullopt;
  if (current) console.Note(config.data.name + ": the inputs have not changed since these results");
  const Outcome<RunResult> result =
      current ? Outcome<RunResult>(*current) : RunPipeline(config, output, NumThreads(), &console);
  if (!result) {
    PrintError(config_path + ": " + result.reason());
    return kWorkFailed;
  }
  // A method that the config names is one that the user expects.
  std::vector<std::string> asked_for = config.options.methods;
  asked_for.push_back(config.options.seed);
  return Finish(config_path, ResultTable(*result, UseColour() ? Colour::kAnsi : Colour::kPlain, asked_for), output,
                result->verdict, fail_on);
}

}  // namespace

int RunCommand_run(const std::vector<std::string>& arguments) {
  const Shard shard = ParseShard();
  const std::optional<Grade> fail_on = FailOn();
  // An explicit --shard requests a batch, even a shard 0/1 of a single config.
  if (arguments.size() == 1 && FLAGS_shard.empty()) return RunOne(arguments[0], fail_on);
  BatchOptions options;
  if (!FLAGS_out.empty()) options.output = std::filesystem::absolute(FLAGS_out).lexically_normal();
  options.settings = Settings();
  options.num_threads = NumThreads();
  options.resume = FLAGS_resume;
  options.shard = shard;
  options.fail_on = fail_on;
  options.verbosity = FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal;
  return RunBatch(arguments, options);
}

}  // namespace heba
