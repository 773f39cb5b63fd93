// The poses of a robot that was recorded as a stream (Dataset::stream), and the offset of its clock to the camera's.
#pragma once

#include <cstddef>
#include <vector>

#include "heba/data/drift.h"
#include "heba/data/image_size.h"
#include "heba/evaluation/finding.h"
#include "heba/run_types.h"

namespace heba {

// Returns the data set with the poses of the stream at the times of its captures plus an offset.
Dataset WithPosesAt(Dataset dataset, double offset_s);

// Returns the velocities of the gripper (VelocityAt) in these captures, indices into Dataset::captures.
std::vector<Tangent6> VelocitiesAt(const Dataset& dataset, double offset_s, const std::vector<size_t>& captures);

// The pose of the target that an image shows.
struct SeenPose {
  size_t capture = 0;  // An index into Dataset::captures.
  Rigid3d camera_from_target;
};
// Returns those of the data set's target_poses or, with a camera that is calibrated from the images alone, of the
// detections; an empty list if there is no such calibration.
std::vector<SeenPose> PosesInImages(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                    const ImageSize& size);

// Returns an offset at which the angles through which the robot turns between captures agree with those that the images
// show; 0 if none is clearly better. The angles do not depend on the hand-eye pose. Offsets of up to two seconds are
// tried.
double FindTimeOffset(const Dataset& dataset, std::vector<SeenPose> seen);

// The finding `time_offset`: the offset that was estimated.
Finding DescribeTimeOffset(const EstimatedTimeOffset& offset);
// The finding `time_offset` of captures that do not determine it.
Finding UndeterminedTimeOffset();

}  // namespace heba
