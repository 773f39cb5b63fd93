// Finds captures whose image files have the same bytes. A camera never takes the same image twice: noise makes them
// differ.
//
// If the robot poses agree, the captures are copies of one capture. They would be counted as independent observations,
// and would be in the held-out and in the remaining captures at once, so only the first one is used. If the poses
// differ, at most one of them belongs to the image, and it is unknown which one: none of the captures is used.
#pragma once

#include <string>
#include <vector>

#include "heba/run_types.h"

namespace heba {

// An image of one camera, and the poses of all arms at which it was taken.
struct PosedImage {
  std::string name;
  std::vector<Rigid3d> base_from_gripper;
  std::string digest;  // CaptureDetection::image_digest; images without a digest are shared by no captures.
  bool shows_target = true;
};
// The images of one camera that were searched, and the capture of each.
struct ImagesOfCamera {
  std::vector<PosedImage> images;
  std::vector<size_t> captures;
};
ImagesOfCamera PosedImagesOf(const Dataset& dataset, const std::vector<TargetDetection>& detections, size_t camera);

// Indices of two or more images with the same bytes, in their order.
struct SharedImage {
  std::vector<size_t> images;
  // Whether all robot poses are equal within 0.1 mm and 0.01 deg: the readings of a robot that stands still differ a
  // little.
  bool has_one_pose = true;
};
std::vector<SharedImage> FindSharedImages(const std::vector<PosedImage>& images);

// Returns the first image of `shared` whose pose differs from that of `image`, for images with several poses.
size_t FindOtherPose(const std::vector<PosedImage>& images, const SharedImage& shared, size_t image);

// An image that must not be used because of another one.
struct DuplicateImage {
  size_t image = 0;
  std::string repeat_of;  // The name of the image that it copies; empty if the poses contradict each other.
  std::string reason;     // One clause.
};
// Returns the images that must not be used, in their order. Images that show no target, such as black ones, may be
// equal.
std::vector<DuplicateImage> FindDuplicates(const std::vector<PosedImage>& images);

// An image of a data set that must not be used.
struct DuplicateInDataset {
  size_t capture = 0;
  size_t camera = 0;
  std::string repeat_of;  // DuplicateImage::repeat_of.
  std::string reason;
};
std::vector<DuplicateInDataset> FindDuplicates(const Dataset& dataset, const std::vector<TargetDetection>& detections);

// Returns whether the image of a detection is one of these.
bool IsDuplicate(const std::vector<DuplicateInDataset>& duplicates, const TargetDetection& detection);

// Returns one sentence for each cause of duplicates among the captures of one camera.
std::vector<std::string> DuplicateNotes(const std::vector<DuplicateInDataset>& duplicates, size_t num_captures);

// Returns the entries of images with the reason of those that must not be used, and their points as `detections` has
// them.
std::vector<ImageResult> WithDuplicates(std::vector<ImageResult> images, const Dataset& dataset,
                                        const std::vector<DuplicateInDataset>& duplicates,
                                        const std::vector<TargetDetection>& detections);

}  // namespace heba
