#include "tools/doctor/doctor.h"

#include <filesystem>
#include <iostream>
#include <optional>

#include "heba/base/error.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/run_config.h"
#include "tools/doctor/cell_doctor.h"
#include "tools/doctor/diagnosis_output.h"
#include "tools/doctor/pose_guess.h"
#include "tools/text/console.h"

namespace heba {
namespace {

Symptom UnreadablePoses(const std::string& fault, const GuessedReading& guessed) {
  const std::optional<PoseFit>& fit = guessed.diagnosis.pose_fit;
  std::string why = "; this is a guess from the size of the numbers, because the images cannot determine it";
  if (guessed.fits) why = ", which fits the images (robot and images differ by " + fit->misfit + ")";
  if (fit && !guessed.fits) why = "; but no format that was tried fits the images";
  const bool is_known = !fit || guessed.fits;
  const std::vector<ConfigSetting> settings = {{"captures.pose_format", PoseFormatText(guessed.format)}};
  return {Severity::kWrong, "pose_format",
          "the poses cannot be read as the config says: " + fault + "; they seem to be " +
              ReadingInWords(guessed.format) + why,
          is_known ? "set " + SettingsText(settings)
                   : "state the meaning of the columns (captures.pose_format: {columns: [...], ...})",
          is_known ? settings : std::vector<ConfigSetting>()};
}

void Print(const std::string& name, const Diagnosis& diagnosis) {
  std::cout << (FLAGS_json ? DiagnosisToJson(name, diagnosis) : ForTerminal(DiagnosisText(name, diagnosis)))
            << std::flush;
}

}  // namespace

int RunCommand_doctor(const std::vector<std::string>& arguments) {
  const Verbosity verbosity = FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal;
  std::optional<RunConfig> config;
  std::string fault;
  try {
    config = ReadRunConfig(arguments[0], Settings());
  } catch (const InputError& error) {
    if (IsLongConfig(arguments[0], Settings())) throw;
    fault = error.what();
  }
  if (config) {
    Print(config->data.name, Diagnose(*config, NumThreads(), verbosity));
    return kDone;
  }
  // Poses that cannot be read as the config says may have another format.
  std::optional<GuessedReading> guessed = GuessReading(arguments[0], Settings(), NumThreads(), verbosity);
  if (!guessed) throw InputError(fault);
  guessed->diagnosis.symptoms.insert(guessed->diagnosis.symptoms.begin(), UnreadablePoses(fault, *guessed));
  Print(std::filesystem::path(arguments[0]).stem().string(), guessed->diagnosis);
  return kDone;
}

}  // namespace heba
