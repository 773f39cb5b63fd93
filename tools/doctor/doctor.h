// Diagnoses a data set: runs every check of checks.def on the data as corrected by the checks before.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/config/run_config.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/text/console.h"

namespace heba {

struct Diagnosis {
  int num_captures = 0;
  int num_seen = 0;  // Number of captures with a pose of the target.
  // Faults precede remarks; a fault that hides others precedes them.
  std::vector<Symptom> symptoms;
  std::optional<PoseFit> pose_fit;
  int NumWrong() const;
};

// The scope of an examination: the inputs alone, or also the result that they lead to.
enum class Examine { kInputs, kInputsAndResult };

// Diagnoses a data set. Throws InputError if the images cannot be read.
Diagnosis Diagnose(const RunConfig& config, int num_threads, Verbosity verbosity,
                   Examine examine = Examine::kInputsAndResult);

// Returns the first fault as a clause with its cure; empty if there is none.
std::string FirstWrong(const Diagnosis& diagnosis);

}  // namespace heba
