#include "tools/doctor/doctor.h"

#include <iostream>

#include "tools/command.h"
#include "tools/console.h"
#include "tools/flags.h"
#include "tools/run_config.h"

namespace heba {
namespace {

std::string DiagnosisText(const std::string& name, const Diagnosis& diagnosis) {
  const auto num_wrong = static_cast<size_t>(diagnosis.NumWrong());
  const size_t num_remarks = diagnosis.symptoms.size() - num_wrong;
  std::string text = name + ": " + std::to_string(diagnosis.num_captures) + " captures, " +
                     std::to_string(diagnosis.num_seen) + " of them show a pose of the target; " +
                     (num_wrong == 0 ? "nothing is wrong" : std::to_string(num_wrong) + " wrong") + ", " +
                     std::to_string(num_remarks) + (num_remarks == 1 ? " remark\n" : " remarks\n");
  int number = 0;
  for (const Symptom& symptom : diagnosis.symptoms) {
    text += std::to_string(++number) + ". " + (symptom.severity == Severity::kWrong ? "wrong" : "remark") + " [" +
            symptom.code + "]: " + symptom.what + "\n";
    if (!symptom.cure.empty()) text += "   -> " + symptom.cure + "\n";
  }
  return text;
}

}  // namespace

int RunCommand_doctor(const std::vector<std::string>& arguments) {
  const RunConfig config = ReadRunConfig(arguments[0], Settings());
  const Diagnosis diagnosis = Diagnose(config, NumThreads(), FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  std::cout << ForTerminal(DiagnosisText(config.name, diagnosis)) << std::flush;
  return kDone;
}

}  // namespace heba
