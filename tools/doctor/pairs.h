// The pairs of a camera and a target of a rig that one arm moves against each other, each diagnosed as a data set of
// one camera.
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "heba/run.h"
#include "tools/config/run_config.h"
#include "tools/doctor/doctor.h"
#include "tools/text/console.h"

namespace heba {

// A camera and a target that one arm moves against each other.
struct DoctorPair {
  size_t camera = 0;
  size_t target = 0;
  size_t robot = 0;
  std::vector<size_t> captures;  // The captures in which the camera sees the target, or no target.
  int num_seen = 0;
  bool is_target_known = false;  // Whether some images of the cell, of any camera, show the whole target.
};

// A pair, diagnosed as a data set of one camera.
struct DiagnosedPair {
  DoctorPair pair;
  Diagnosis diagnosis;
};

// Fewer images do not tell whether they fit the poses.
inline constexpr int kEnoughImages = 6;
// Faults because of which the images of a pair do not fit its poses.
inline constexpr std::string_view kOfPoses[] = {"rotation_format", "angle_unit",       "pose_units",
                                                "pose_direction",  "rotation_inverse", "other_arm",
                                                "pairing",         "target_scale",     "poses_unexplained"};

template <class Names>
bool IsIn(const Names& names, const SymptomCode& code) {
  return std::find(std::begin(names), std::end(names), code.name()) != std::end(names);
}

// Returns whether enough points are detected to determine the pose of the target.
bool IsSeen(const TargetDetection& detection);

// Returns the pairs to diagnose: those with enough images and, for a camera without such a pair, the one with the most.
std::vector<DoctorPair> PairsOf(const RunConfig& config, const std::vector<TargetDetection>& detections);

// Returns the data set of a pair as that of one camera, with the kinematics and the recorded joints of its arm.
RunConfig ConfigWithArm(const RunConfig& config, const DoctorPair& pair);

// Diagnose pairs as data sets of one camera.
Diagnosis DiagnosePair(const RunConfig& config, const DoctorPair& pair, int num_threads, Verbosity verbosity);
std::vector<DiagnosedPair> DiagnosePairs(const RunConfig& config, std::vector<DoctorPair> pairs, int num_threads,
                                         Verbosity verbosity);

// Returns a symptom of a pair with the keys of the rig's config.
Symptom InLongForm(const RunConfig& config, const DoctorPair& pair, Symptom symptom);

// Returns whether a pair has a symptom with one of these codes that is wrong.
template <class Codes>
bool HasWrong(const DiagnosedPair& diagnosed, const Codes& codes) {
  const std::vector<Symptom>& symptoms = diagnosed.diagnosis.symptoms;
  return std::any_of(symptoms.begin(), symptoms.end(), [&](const Symptom& symptom) {
    return symptom.severity == Severity::kWrong && IsIn(codes, symptom.code);
  });
}

// Returns whether the images of a pair are known to fit the poses of its arm.
bool FitsPoses(const DiagnosedPair& diagnosed);

// Joins names: "camera left", or "cameras left, right".
std::string NamesText(const char* one, const char* several, const std::set<std::string>& names);
// Names the parts of the rig in these pairs: "cameras left, right, target plate".
std::string WhereText(const RunConfig& config, const std::vector<DoctorPair>& pairs);

}  // namespace heba
