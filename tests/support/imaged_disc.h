// The image of a disc, computed from the camera model alone.
#pragma once

#include <Eigen/Core>

#include "heba/camera/camera.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// Returns the centroid, px, of the image of a disc in the plane z = 0 of the target: that of a fine polygon on its
// outline. The camera must see the whole disc.
Eigen::Vector2d ImagedCentroid(const Camera& camera, const Rigid3d& camera_from_target,
                               const Eigen::Vector3d& centre_in_target, double radius_m);

}  // namespace heba
