// Finds captures whose image files have the same bytes. A camera never takes the same image twice: noise makes them
// differ.
//
// If the robot poses agree, the captures are copies of one capture. They would be counted as independent observations,
// and would be in the held-out and in the remaining captures at once, so only the first one is used. If the poses
// differ, at most one of them belongs to the image, and it is unknown which one: none of the captures is used.
#pragma once

#include <vector>

#include "heba/run_types.h"

namespace heba {

// Captures of Dataset::captures that share one image, two or more, in their order.
struct SharedImage {
  std::vector<size_t> captures;
  // Whether all robot poses are equal within 0.1 mm and 0.01 deg: the readings of a robot that stands still differ a
  // little.
  bool has_one_pose = true;
};

// Finds shared images by CaptureDetection::image_digest; captures without a digest share no image. `detections` are
// those of `captures`, or empty if there are no images.
std::vector<SharedImage> FindSharedImages(const std::vector<Capture>& captures,
                                          const std::vector<CaptureDetection>& detections);

// Returns the first capture of `shared` whose pose differs from that of `capture`, for captures that share an image
// but not the pose.
size_t FindOtherPose(const std::vector<Capture>& captures, const SharedImage& shared, size_t capture);

// Removes the captures that must not be used from `dataset` and `detections`.
LeftOutCaptures LeaveOutSharedImages(Dataset* dataset, std::vector<CaptureDetection>* detections);

// Inserts the captures that were left out at their indices among the results of the others.
void InsertLeftOut(const LeftOutCaptures& left_out, std::vector<CaptureResult>* results);

}  // namespace heba
