// Runs the whole calibration of one config of a rig and writes a run's folder.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/rig_evaluation.h"
#include "tools/config/rig_config.h"
#include "tools/text/console.h"

namespace heba {

// Detects, calibrates, evaluates and writes the run's folder completely or not at all. Throws InputError for wrong
// input. `listener`, which may be null, is told about the stages and can cancel the run. Returns a Failure, and writes
// no folder, if the result cannot be trusted.
Outcome<RigResult> RunRigPipeline(const RigConfig& config, const std::filesystem::path& output, int num_threads,
                                  Console* console, RunObserver* listener = nullptr);

// Returns a line for each camera and target: how many images of the camera determine a pose of the target.
std::vector<std::string> DetectionNotes(const RigDataset& data, const std::vector<RigDetection>& detections);

// Returns a line for each image that was not used, or of which a target was not used: with its capture, its camera and
// the reason. Images of one camera with one reason have one line, with the first and the last of them.
std::vector<std::string> LeftOutNotes(const std::vector<RigImageResult>& images);

// Returns the complete result in `output` if it was made from the same inputs; nothing otherwise, or if it cannot be
// read.
std::optional<RigResult> CurrentRigResult(const std::filesystem::path& output, const RigConfig& config);

}  // namespace heba
