// Data sets with given detections from simulated scenes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/data/setup.h"
#include "heba/run.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/scenes.h"

namespace heba {

// Returns the data set of a scene whose points are those of `target`, with the scene's camera.
Dataset DatasetOf(const TestScene& scene, Setup setup, std::shared_ptr<const Target> target);

// Returns a data set of one camera with some of the captures, in this order, and their detections.
Dataset PartOf(const Dataset& dataset, const std::vector<size_t>& captures);

// Gives the only arm of a data set its kinematics and the positions of its joints.
void SetArm(const ArmScene& scene, Dataset* dataset);

// Returns the options of a run without a cross-validation.
RunOptions WithoutFolds();
// Takes the camera of a data set as it is given.
Dataset WithFixedCamera(Dataset dataset);

// A data set of an arm, whose captures are sorted by configuration, as a path visits them.
struct ArmDataset {
  Dataset dataset;
  std::vector<std::string> configuration;   // One per capture.
  std::vector<Rigid3d> camera_from_target;  // Likewise, free of noise.
};

// Returns captures of a chessboard in three configurations of an arm of six joints, `in_third` of `num_captures` in the
// last one.
ArmDataset ThreeConfigurations(uint64_t seed, ArmSceneOptions options, size_t num_captures, size_t in_third);

// Returns a data set of one arm with a stream that passes the poses of its captures, one every two seconds, while the
// camera's clock is behind that of the robot by an offset. The poses of the captures are those at their times.
Dataset OnStream(Dataset dataset, double offset_s);

// Returns the names of the captures that are not used.
std::vector<std::string> LeftOutOf(const RunResult& result);

}  // namespace heba
