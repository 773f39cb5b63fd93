// Runs the whole calibration of one config and writes a run's folder.
#pragma once

#include <filesystem>
#include <optional>

#include "heba/base/error.h"
#include "heba/evaluation/run_result.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"

namespace heba {

// Detects, calibrates, evaluates and writes the run's folder completely or not at all. Throws InputError for wrong
// input. `listener`, which may be null, is told about the stages and can cancel the run. Returns a Failure, and writes
// no folder, if the result cannot be trusted. The first fault that the doctor (doctor/cell_doctor.h) finds is part of
// the Failure, and of the findings of a result that is bad.
Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console, RunObserver* listener = nullptr);

// Returns the complete result in `output` if it was made from the same inputs; nothing otherwise, or if it cannot be
// read.
std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const RunConfig& config);

}  // namespace heba
