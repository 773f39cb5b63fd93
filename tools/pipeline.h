// The main job: a config in, a run's folder out.
#pragma once

#include <filesystem>
#include <string>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"
#include "targets/detection.h"
#include "tools/console.h"
#include "tools/run_config.h"

namespace heba {

// Detects, calibrates, evaluates and writes the run's folder, whole or not at all. InputError for wrong input; a
// Failure, and no folder, if the result cannot be trusted.
Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console);

// Detections of all captures, with progress on the terminal. InputError if pictures differ in size or disagree with the
// camera file; the camera's size is filled in from them where it has none.
std::vector<CaptureDetection> DetectCaptures(RunConfig* config, int num_threads, Verbosity verbosity);

}  // namespace heba
