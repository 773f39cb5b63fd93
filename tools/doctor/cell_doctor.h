// Diagnoses the data set of a config: every pair of a camera and a target as a data set of its own, and then the whole.
#pragma once

#include "heba/calibration.h"
#include "tools/config/run_config.h"
#include "tools/doctor/doctor.h"
#include "tools/text/console.h"

namespace heba {

// Diagnoses the data set of a config: one in the short form by DiagnosePair. Pairs of a camera and a target that one
// arm moves against each other are diagnosed as a data set of one camera; a symptom that all pairs of an arm or of a
// target share is reported once. If nothing is wrong with them, the findings of the adjustment of all follow. Throws
// InputError if the images cannot be read.
Diagnosis Diagnose(const RunConfig& config, int num_threads, Verbosity verbosity,
                   Examine examine = Examine::kInputsAndResult);

// Returns whether a motion of a camera that a calibration has found explains a symptom of the inputs: the images of the
// camera that do not fit its other ones, or what the pixels show of the motion.
bool IsExplainedByMotion(const Symptom& symptom, const Calibration& calibration);

}  // namespace heba
