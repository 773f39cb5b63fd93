// Which target images show, if nobody has said it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "heba/target.h"

namespace heba {

// A target that images show, but for its size, which images do not tell.
struct RecognisedTarget {
  // All keys of the target. Its lengths are those of a target whose first one, `size_key`, is 1 m.
  TargetSettings settings;
  std::string size_key;  // square, spacing or tag_size.
  std::shared_ptr<const Target> target;
  int num_images = 0;     // The number of images in which enough of it is seen for a pose.
  size_t num_points = 0;  // The number of its points in all images.
};

// Returns the targets that the images (CV_8UC1) show, that with the most points first. Each type of target proposes
// what it finds, and a proposal is returned if its own detector then finds the target in at least one image; of
// proposals of one type, the best remains. A type whose points are a part of another target's, such as the chessboard
// of a ChArUco board, is returned only if it is found where the other is not.
std::vector<RecognisedTarget> RecogniseTargets(const std::vector<cv::Mat>& images, int num_threads = 1);

// Returns the keys of a recognised target of a size, as one line of a config. `size` replaces its main length, such as
// 25 mm; its other lengths follow. With an empty size, the lengths are SIZE and multiples of it, to be filled in.
std::string RecognisedTargetText(const RecognisedTarget& recognised, double size_m = 0);

}  // namespace heba
