// Captures whose image files have the same bytes. A camera never takes the same image twice: noise makes them differ.
//
// With one pose of the robot, the captures are copies of one capture. They would be counted as independent
// observations, and would be in the held-out and in the remaining captures at once, so only the first one counts. With
// different poses, at most one of the poses belongs to the image, and nothing tells which one: none of the captures is
// used.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "targets/detection.h"
#include "tools/config/run_config.h"

namespace heba {

// Captures of RunConfig::captures that share one image, two or more, in their order.
struct SharedImage {
  std::vector<size_t> captures;
  // All poses of the robot are equal, within 0.1 mm and 0.01 deg: a robot that stands still is read a little
  // differently each time.
  bool has_one_pose = true;
};

// By CaptureDetection::image_digest; captures without one share no image. `detections` are those of `captures`,
// or none where there are no images.
std::vector<SharedImage> FindSharedImages(const std::vector<Capture>& captures,
                                          const std::vector<CaptureDetection>& detections);

// Returns the first capture of `shared` whose pose is not that of `capture`, for captures that share an image but not
// the pose.
size_t FindOtherPose(const std::vector<Capture>& captures, const SharedImage& shared, size_t capture);

// The captures that were left out, and one sentence on them for each cause.
struct LeftOutCaptures {
  std::vector<size_t> indices;         // Increasing.
  std::vector<CaptureResult> results;  // Not used, with the reason.
  std::vector<std::string> notes;
};

// Removes the captures that must not count from `config` and `detections`.
LeftOutCaptures LeaveOutSharedImages(RunConfig* config, std::vector<CaptureDetection>* detections);

// Puts the captures that were left out back in their places among the results of the others.
void InsertLeftOut(const LeftOutCaptures& left_out, std::vector<CaptureResult>* results);

}  // namespace heba
