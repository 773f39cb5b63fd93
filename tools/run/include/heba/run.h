// Runs a whole calibration: from a data set (images or detections of any number of cameras and targets, and the poses
// of the arms) to a result with its errors, uncertainties and findings. This is all that `heba run` does between its
// config and its files.
//
//   heba::Dataset dataset = heba::DatasetOf(
//       heba::Setup::kEyeInHand, heba::ParseTarget("{type: chessboard, rows: 8, columns: 11, square: 15 mm}"));
//   for (const auto& [image, base_from_gripper] : recorded) {
//     dataset.captures.push_back({image.filename(), {base_from_gripper}, {image}});
//   }
//   const heba::Outcome<heba::RunOutput> output = heba::Run(dataset, heba::RunOptions());
//   if (!output) throw std::runtime_error(output.reason());
//   const heba::Rigid3d& gripper_from_camera = output->result.solution.poses.mount_from_camera[0];
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "heba/base/error.h"
#include "heba/data/setup.h"
#include "heba/run_types.h"
#include "heba/target.h"

namespace heba {

// Returns a data set of one camera, one target and one arm, which have no names, without captures. The camera is
// estimated if it is not given.
Dataset DatasetOf(Setup setup, std::shared_ptr<const Target> target, const std::optional<Camera>& camera = {});

// Detects the targets in the images, calibrates, searches the images again for points that were missed, and assesses
// the result on held-out captures (docs/estimation.md). The result of one camera, one target and one arm has the
// estimates of the closed forms beside the refined one. `observer` may be null. Returns a Failure if the result cannot
// be trusted, or if the run was cancelled. Throws InputError if the data set is incomplete, if an image cannot be read,
// if the images of a camera differ in size, or if a camera is not for images of that size.
Outcome<RunOutput> Run(const Dataset& dataset, const RunOptions& options, RunObserver* observer = nullptr);

// Returns why two targets of a data set cannot be told apart in one image (Target::Codes), in words; empty if they can.
std::string WhyNotToldApart(const Dataset& dataset);

}  // namespace heba
