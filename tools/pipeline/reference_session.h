// A check without a robot: images of a camera and targets that stand still, beside reference images of them.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "tools/config/finished_run.h"
#include "tools/pipeline/session.h"

namespace heba {

// A ReferenceSession is what CheckSession takes. Camera and targets stand in one base.
struct ReferenceSession {
  Problem problem;                 // Its captures have the points of the images, one each.
  Solution solution;               // The poses of the targets are those of the reference images, with their covariance.
  std::vector<std::string> notes;  // One sentence for each image that is not used.
};

// Detects the targets of a run in reference images and in later ones, all of one camera, whose lens is that of the run.
// Targets that the reference images do not show are not used. Throws InputError if an image cannot be read, is not of
// the size of the calibration's, or if no reference image determines the pose of a target.
ReferenceSession ReadReferenceSession(const FinishedRun& run, const std::vector<SessionImage>& references,
                                      const std::vector<SessionImage>& images, int num_threads);

}  // namespace heba
