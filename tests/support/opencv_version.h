// Tests compare with OpenCV, whose behaviour differs between versions.
#pragma once

#include <opencv2/core/version.hpp>

namespace heba {

// Returns whether the OpenCV of this build is of an earlier version than `major`.`minor`.
constexpr bool IsOpenCvBefore(int major, int minor) {
  return CV_VERSION_MAJOR < major || (CV_VERSION_MAJOR == major && CV_VERSION_MINOR < minor);
}

}  // namespace heba
