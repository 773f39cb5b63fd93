// A check tests the images of a later session, at poses of the arms or beside reference images.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/session_check.h"
#include "tools/config/finished_run.h"
#include "tools/pipeline/session.h"

namespace heba {

// A CheckedSession holds what CheckSession takes.
struct CheckedSession {
  Problem problem;
  Solution solution;
  SessionOptions options;
  std::vector<std::string> notes;  // One sentence for each image that is not used.
};

// Reads images that were taken at these poses of the arms, and detects the targets in them; `is_target_in_place`:
// whether the targets are mounted as they were for the calibration. There must be an image. Throws InputError like
// ReadSession.
CheckedSession SessionAtPoses(const FinishedRun& run, const std::vector<SessionImage>& images,
                              const std::vector<ArmsAtImage>& poses, bool is_target_in_place, int num_threads);

// Reads images, at least one, of one camera that stands still, as its targets do, and the reference images: one, or
// those of a folder.
// Throws InputError if the images are those of several cameras or the folder has none, and like ReadReferenceSession.
CheckedSession SessionBesideReferences(const FinishedRun& run, const std::filesystem::path& reference,
                                       const std::vector<SessionImage>& images, int num_threads);

// Returns why a check of these images decided nothing: the text of the failure and, if none of them shows a target of
// the run, the target that they show. That takes a second or more.
std::string WhyUndecided(const Failure& failure, const std::vector<SessionImage>& images, int num_threads);

}  // namespace heba
