// Writes the simulated data set of a rig.
#pragma once

#include <filesystem>
#include <string>

#include "heba/base/error.h"
#include "tools/config/rig_scene_config.h"
#include "tools/text/console.h"

namespace heba {

// Renders the images of every camera at every capture, and writes them with the poses, targets, cameras, the config for
// `heba run` and the truth, completely or not at all. Returns the number of images, or a Failure if a target does not
// fit into an image.
Outcome<int> WriteRigDataSet(const RigSceneConfig& scene, const std::filesystem::path& output, int num_threads,
                             Verbosity verbosity);

}  // namespace heba
