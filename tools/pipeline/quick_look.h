// A quick look says within milliseconds whether new captures agree with a finished run of the captures before them, and
// how well the camera's pose is known with them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/detection.h"
#include "tools/config/finished_run.h"
#include "tools/pipeline/session.h"

namespace heba {

// Returns one clause about images that were taken at these poses of the arms, in which the targets were detected
// (SessionOf): whether they agree with the run (CheckSession) and, of a single camera, the sigmas of its pose with
// them: the run's result counts as an observation beside them (equation 19 of docs/estimation.md). Empty if the images
// say nothing.
std::string QuickLook(const std::shared_ptr<const FinishedRun>& run, const std::vector<SessionImage>& images,
                      const std::vector<ArmsAtImage>& poses, const std::vector<std::vector<Detection>>& seen);

}  // namespace heba
