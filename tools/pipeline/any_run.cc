#include "tools/pipeline/any_run.h"

#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tools/pipeline/pipeline.h"
#include "tools/pipeline/run_inputs.h"

namespace heba {

AnyConfig ReadAnyConfig(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  if (IsLongConfig(path, settings)) return ReadRunConfig(path, settings);
  return ReadPairConfig(path, settings);
}

Outcome<RunResult> RunAny(const AnyConfig& config, const std::filesystem::path& output, int num_threads,
                          Console* console, RunObserver* listener) {
  return std::visit([&](const auto& of_run) { return RunPipeline(of_run, output, num_threads, console, listener); },
                    config);
}

std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const AnyConfig& config) {
  const std::filesystem::path inputs = output / "inputs.json";
  const std::filesystem::path result = output / "result.json";
  std::error_code error;
  if (!std::filesystem::exists(inputs, error) || !std::filesystem::exists(result, error)) return std::nullopt;
  try {
    const std::string current = std::visit([](const auto& of_run) { return RunInputsText(of_run); }, config);
    if (ReadTextFile(inputs) != current) return std::nullopt;
    return ReadRunResult(result);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace heba
