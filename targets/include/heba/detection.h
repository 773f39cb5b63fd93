// Detects the target in the images of a data set.
//
//   const heba::CaptureDetection capture = heba::DetectCapture(*target, "images/007.png");
//   const heba::Observations observations = heba::ObservationsOf(*target, capture.detection);
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera.h"
#include "heba/data/image_size.h"
#include "heba/data/pair_problem.h"
#include "heba/target.h"

namespace heba {

struct CaptureDetection {
  int width_px = 0;
  int height_px = 0;
  Detection detection;
  int num_second_pass = 0;  // Number of points that only the second pass found.
  std::string small_jpeg;   // A reduced copy of the image, for people to look at.
  // The digest of the image file's bytes, set by the caller that computed it; equal digests mean equal files. Empty
  // if it is unknown.
  std::string image_digest = {};
};

// Detects the target in one image. The result does not depend on the images processed before. Throws InputError if
// the image cannot be read or its size differs from `expected`.
CaptureDetection DetectCapture(const Target& target, const std::filesystem::path& image,
                               const std::optional<ImageSize>& expected = std::nullopt);

// Returns the pixel at which the camera sees a point of the target, as detectors measure it: a disc is measured by
// the centroid of its imaged area. Returns nothing if the point has no image.
std::optional<Eigen::Vector2d> PixelOf(const TargetPoint& point, const Camera& camera,
                                       const Rigid3d& camera_from_target);

// Returns the detected points with their positions on the target.
Observations ObservationsOf(const Target& target, const Detection& detection);
// Returns all points of the target, as in a capture that sees them all; the pixels are zero and have no meaning.
Observations AllPoints(const Target& target);

}  // namespace heba
