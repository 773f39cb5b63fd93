#include "tools/doctor/doctor.h"

#include <filesystem>
#include <iostream>
#include <optional>

#include "heba/base/error.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/run_config.h"
#include "tools/doctor/pose_guess.h"
#include "tools/text/console.h"

namespace heba {
namespace {

std::string DiagnosisText(const std::string& name, const Diagnosis& diagnosis) {
  const auto num_wrong = static_cast<size_t>(diagnosis.NumWrong());
  const size_t num_remarks = diagnosis.symptoms.size() - num_wrong;
  std::string text = name + ": " + std::to_string(diagnosis.num_captures) + " captures, " +
                     std::to_string(diagnosis.num_seen) + " of them determine a pose of the target; " +
                     (num_wrong == 0 ? "nothing is wrong" : std::to_string(num_wrong) + " wrong") + ", " +
                     std::to_string(num_remarks) + (num_remarks == 1 ? " remark\n" : " remarks\n");
  // Only the first of many similar symptoms are printed, with their cure once.
  constexpr size_t kMostAlike = 4;
  size_t alike = 0;
  for (size_t i = 0; i < diagnosis.symptoms.size(); ++i) {
    const Symptom& symptom = diagnosis.symptoms[i];
    const bool is_last_alike = i + 1 == diagnosis.symptoms.size() || diagnosis.symptoms[i + 1].code != symptom.code ||
                               diagnosis.symptoms[i + 1].cure != symptom.cure;
    ++alike;
    if (alike <= kMostAlike) {
      text += std::to_string(i + 1) + ". " + (symptom.severity == Severity::kWrong ? "wrong" : "remark") + " [" +
              std::string(symptom.code.name()) + "]: " + symptom.what + "\n";
    }
    if (!is_last_alike) continue;
    if (alike > kMostAlike) {
      text += "   and " + std::to_string(alike - kMostAlike) + " more [" + std::string(symptom.code.name()) +
              "] of this kind\n";
    }
    if (!symptom.cure.empty()) text += "   -> " + symptom.cure + "\n";
    alike = 0;
  }
  return text;
}

Symptom UnreadablePoses(const std::string& fault, const GuessedReading& guessed) {
  const std::optional<PoseFit>& fit = guessed.diagnosis.pose_fit;
  std::string why = "; this is a guess from the size of the numbers, because the images cannot determine it";
  if (guessed.fits) why = ", which fits the images (robot and images differ by " + fit->misfit + ")";
  if (fit && !guessed.fits) why = "; but no format that was tried fits the images";
  return {Severity::kWrong, "pose_format",
          "the poses cannot be read as the config says: " + fault + "; they seem to be " +
              ReadingInWords(guessed.format) + why,
          fit && !guessed.fits ? "state the meaning of the columns (captures.pose_format: {columns: [...], ...})"
                               : "set captures.pose_format: " + PoseFormatText(guessed.format)};
}

}  // namespace

int RunCommand_doctor(const std::vector<std::string>& arguments) {
  const Verbosity verbosity = FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal;
  std::optional<RunConfig> config;
  std::string fault;
  try {
    config = ReadRunConfig(arguments[0], Settings());
  } catch (const InputError& error) {
    fault = error.what();
  }
  if (config) {
    const Diagnosis diagnosis = Diagnose(*config, NumThreads(), verbosity);
    std::cout << ForTerminal(DiagnosisText(config->data.name, diagnosis)) << std::flush;
    return kDone;
  }
  // Poses that cannot be read as the config says may have another format.
  std::optional<GuessedReading> guessed = GuessReading(arguments[0], Settings(), NumThreads(), verbosity);
  if (!guessed) throw InputError(fault);
  guessed->diagnosis.symptoms.insert(guessed->diagnosis.symptoms.begin(), UnreadablePoses(fault, *guessed));
  std::cout << ForTerminal(DiagnosisText(std::filesystem::path(arguments[0]).stem().string(), guessed->diagnosis))
            << std::flush;
  return kDone;
}

}  // namespace heba
