// Proposes a target for a paper, a camera and a distance.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera.h"

namespace heba {

// What the target is for.
struct TargetPurpose {
  Eigen::Vector2d paper_mm = {210, 297};  // In either format.
  double distance_m = 0;                  // From the camera to the target.
  Camera camera;                          // With its image size.
};

struct SuggestedTarget {
  std::string yaml;             // As ParseTarget reads it, a key a line.
  Eigen::Vector2d size_mm;      // Of the printed drawing.
  double feature_px = 0;        // The size of its dots, squares or tag cells in the image.
  double least_feature_px = 0;  // The size from which on it is detected reliably; feature_px may be smaller.
  double share_of_height = 0;   // The share of the image's height that it covers when seen from the front.
};

// Returns the target of a type, one of TargetTypeNames(), whose features are as large as they must be and that has as
// many of them as fit on the paper (with its rulers and margins) and into two thirds of the image; round sizes, and no
// symmetry. Features are larger where the paper allows it.
SuggestedTarget SuggestTarget(std::string_view type, const TargetPurpose& purpose);

}  // namespace heba
