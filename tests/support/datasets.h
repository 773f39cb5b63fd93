// Data sets with given detections from simulated scenes.
#pragma once

#include <memory>

#include "heba/data/setup.h"
#include "heba/run.h"
#include "tests/support/scenes.h"

namespace heba {

// Returns the data set of a scene whose points are those of `target`, with the scene's camera.
Dataset DatasetOf(const TestScene& scene, Setup setup, std::shared_ptr<const Target> target);

}  // namespace heba
