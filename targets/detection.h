// A data set's pictures -> what is seen in them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera.h"
#include "heba/data/problem.h"
#include "targets/images/image.h"
#include "targets/target.h"

namespace heba {

struct CaptureDetection {
  int width_px = 0;
  int height_px = 0;
  Detection detection;
  int num_second_pass = 0;  // Of the points, those that the second look added.
  std::string small_jpeg;   // The picture, small, for people to look at.
  // The digest of the image file's bytes, set by the caller that computed it: equal digests mean equal files. Empty if
  // it is not known.
  std::string image_digest = {};
};

// Searches one picture, whatever was searched before. InputError if it cannot be read or is of another size than
// `expected`.
CaptureDetection DetectCapture(const Target& target, const std::filesystem::path& image,
                               const std::optional<ImageSize>& expected = std::nullopt);

// Where a camera sees a point of the target, as detectors measure it: a disc by the centroid of its image. Nothing if
// it has no image.
std::optional<Eigen::Vector2d> PixelOf(const TargetPoint& point, const Camera& camera,
                                       const Rigid3d& camera_from_target);

// The detected points with their places on the target.
Observations ObservationsOf(const Target& target, const Detection& detection);
// All of the target's points as a capture that sees them all has them; the pixels mean nothing.
Observations AllPoints(const Target& target);

}  // namespace heba
