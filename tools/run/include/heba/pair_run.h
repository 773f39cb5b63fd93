// Runs the whole calibration of one camera, one target and one arm: from a data set (images or detections, and the
// robot's poses) to a result with its errors, uncertainties and findings. This is all that `heba run` does between its
// config and its files. heba/run.h has the same for any number of cameras, targets and arms.
//
//   heba::PairDataset dataset;
//   dataset.setup = heba::Setup::kEyeInHand;
//   dataset.target = heba::ParseTarget("{type: chessboard, rows: 8, columns: 11, square: 15 mm}");
//   for (const auto& [image, base_from_gripper] : recorded) {
//     dataset.captures.push_back({image.filename(), image, {}, base_from_gripper});
//   }
//   const heba::Outcome<heba::RunOutput> output = heba::Run(dataset, heba::PairRunOptions());
//   if (!output) throw std::runtime_error(output.reason());
//   const heba::Rigid3d& gripper_from_camera = output->result.solution.poses.mount_from_camera[0];
#pragma once

#include <filesystem>
#include <optional>

#include "heba/base/error.h"
#include "heba/detection.h"
#include "heba/pair_run_types.h"
#include "heba/run_types.h"
#include "heba/target.h"

namespace heba {

// Detects the target in the images, calibrates, searches the images again for points that were missed, and assesses
// the result on held-out captures (docs/estimation.md). With `target_poses`, it calibrates from these poses. `observer`
// may be null. Returns a Failure if the result cannot be trusted, or if the run was cancelled. Throws InputError if the
// data set is incomplete, if an image cannot be read, if images differ in size, or if the camera is not for images of
// that size.
Outcome<RunOutput> Run(const PairDataset& dataset, const PairRunOptions& options, RunObserver* observer = nullptr);

}  // namespace heba
