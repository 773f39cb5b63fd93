// Cameras and targets of a rig that are not where the config says.
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "heba/run.h"
#include "tools/config/run_config.h"
#include "tools/doctor/pairs.h"

namespace heba {

// The cameras and targets with a wrong mount, which may be the cause of anything else that is wrong with them.
struct Misplaced {
  std::set<size_t> cameras;
  std::set<size_t> targets;
  bool Contains(size_t camera, size_t target) const { return cameras.contains(camera) || targets.contains(target); }
};

// The symptoms say what is wrong with mounts; `misplaced` has the cameras and targets that they concern.
struct MountSymptoms {
  std::vector<Symptom> symptoms;
  Misplaced misplaced;
};

// Returns pairs that fit the poses of another arm than that of their mounts: files of poses that are exchanged, or
// mounts that name the wrong arm, which are misplaced.
MountSymptoms SymptomsOfOtherArms(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed);

// Returns cameras and targets that stand on one mount by the config, but move against each other in the images: all the
// time, because a mount is wrong and the camera misplaced; or once, because one of them was moved. What is in `known`
// is not reported.
MountSymptoms WrongMounts(const RunConfig& config, const std::vector<TargetDetection>& detections,
                          const Misplaced& known);

}  // namespace heba
