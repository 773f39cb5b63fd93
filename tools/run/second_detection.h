// Searches images again for the points that a first calibration predicts, but that were not detected.
#pragma once

#include <optional>
#include <vector>

#include "heba/run_types.h"

namespace heba {

// Predicts the target's points in a capture, px, from the calibration; nothing for points out of view.
std::vector<std::optional<Eigen::Vector2d>> ExpectedPixels(const Target& target, const Solution& solution,
                                                           const Rigid3d& camera_from_target);

// Searches again for missing points at the positions that the calibration, whose refinement succeeded, predicts.
// Returns the detections in all captures, or nothing if none changed.
std::optional<std::vector<CaptureDetection>> DetectAgain(const Dataset& dataset,
                                                         const std::vector<CaptureDetection>& detections,
                                                         const Calibration& calibration, int num_threads,
                                                         RunObserver* observer);

}  // namespace heba
