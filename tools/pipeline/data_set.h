// Writes the simulated data set of a scene.
#pragma once

#include <filesystem>
#include <string>

#include "heba/base/error.h"
#include "tools/config/scene_config.h"
#include "tools/text/console.h"

namespace heba {

// Throws InputError, which begins with the path of the scene, for arms whose poses cannot be simulated.
void RefuseArms(const SceneConfig& scene, const std::string& path);

// Renders the images of every camera at every capture, and writes them with the poses, joints, targets, cameras, the
// config for `heba run` and the truth, completely or not at all. Returns the number of images, or a Failure if a target
// does not fit into an image, or if an arm does not reach enough poses.
Outcome<int> WriteDataSet(const SceneConfig& scene, const std::filesystem::path& output, int num_threads,
                          Verbosity verbosity);

}  // namespace heba
