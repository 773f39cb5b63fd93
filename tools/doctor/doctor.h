// What is wrong with a data set: every check of checks.def, each on what the ones before it left.
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
  int num_seen = 0;  // With a pose of the target.
  // The wrong before the remarks; of the wrong, the one that hides others first.
  std::vector<Symptom> symptoms;
  std::optional<PoseFit> pose_fit;
  int NumWrong() const;
};

// The scope of an examination: the inputs alone, or also the result that they lead to.
enum class Examine { kInputs, kInputsAndResult };

// InputError if the images cannot be read.
Diagnosis Diagnose(const RunConfig& config, int num_threads, Verbosity verbosity,
                   Examine examine = Examine::kInputsAndResult);

// The first thing that is wrong, as a clause with its cure; empty if nothing is.
std::string FirstWrong(const Diagnosis& diagnosis);

}  // namespace heba
