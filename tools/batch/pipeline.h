// The main job: a config in, a run's folder out.
#pragma once

#include <filesystem>
#include <string>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"

namespace heba {

// Detects, calibrates, evaluates and writes the run's folder, whole or not at all. InputError for wrong input; a
// Failure, and no folder, if the result cannot be trusted. What the doctor (doctor/doctor.h) finds wrong first is in
// the Failure, and among the remarks of a result that is bad.
Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console);

}  // namespace heba
