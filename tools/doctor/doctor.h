// Diagnoses a data set of one camera, one target and one arm: runs every check of checks.def on the data as corrected
// by the checks before.
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
  int num_images = 0;  // Number of images of all cameras of a rig; 0 for one camera.
  int num_seen = 0;    // Number of captures (images, for a rig) with a pose of a target.
  // Faults precede remarks; a fault that hides others precedes them.
  std::vector<Symptom> symptoms;
  std::optional<PoseFit> pose_fit;
  int NumWrong() const;
};

// The scope of an examination: the inputs alone, or also the result that they lead to.
enum class Examine { kInputs, kInputsAndResult };

// Diagnoses such a data set. `rig`: Examination::rig. Throws InputError if the images cannot be read.
Diagnosis DiagnosePair(const RunConfig& config, int num_threads, Verbosity verbosity,
                       Examine examine = Examine::kInputsAndResult, const CellContext& rig = {});

// Returns faults before remarks; the order is otherwise kept.
std::vector<Symptom> BySeverity(std::vector<Symptom> symptoms);

// Returns a finding of a run as a symptom.
Symptom SymptomOf(const Finding& finding);

// Returns the first fault as a clause with its cure, without its evidence; empty if there is none.
std::string FirstWrong(const Diagnosis& diagnosis);

// Explains why a run failed: the first fault that the doctor finds, because it is the cause and the reason of the
// failure its consequence, or the reason alone if the doctor finds none. Faults of single captures, which a calibration
// leaves out, and poses that the doctor cannot explain follow the reason. A text that both contain is given once.
std::string WithDiagnosis(const std::string& reason, const Diagnosis& diagnosis);

// Returns the findings of a run behind the first fault, if there is one, as their cause. A finding with the same code
// is replaced.
std::vector<Finding> WithCause(const Diagnosis& diagnosis, std::vector<Finding> findings);

}  // namespace heba
