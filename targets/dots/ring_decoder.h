// Reads the ring of black and white sectors around a dot: a disc of radius 1 (the dot's own), blank to 2, the sectors
// from 2 to 3, blank again to 3.5. What is not exactly that is not read.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/dots/ellipse_finder.h"
#include "targets/dots/ellipse_refinement.h"

namespace heba {

struct RingReading {
  uint32_t code = 0;
  RefinedEllipse dot;
  // Homography from the ring's plane, in radii of the dot: x along the first edge of the sector that is the code's
  // highest bit, y a quarter turn on in the sense of reading. Its scale is such that points in front have w > 0.
  Eigen::Matrix3d pixel_from_ring = Eigen::Matrix3d::Identity();
  double residual_ratio = 0;  // RMS of what the picture is unlike the ring drawn so, by the contrast.
  // Whether the ring is large and exact enough to be believed alone. Of others some are chance: a small ring with one
  // black sector is a dot with a spot beside it.
  bool is_clear = false;
};

class RingDecoder {
 public:
  // `codes` are those that are read.
  RingDecoder(int bits, DotPolarity polarity, const std::vector<uint32_t>& codes);

  struct Guess;

  // The ring about a dot as FindEllipses finds it; nothing if there is none, or not one of the codes. `grey` is
  // CV_8UC1.
  std::optional<RingReading> Read(const cv::Mat& grey, const Ellipse& candidate) const;

  // Whether Read is likely to find one of the codes there: large rings with clear sectors, told without any fit.
  bool IsLikely(const cv::Mat& grey, const Ellipse& candidate) const;

 private:
  bool IsAlone(const cv::Mat& grey, const Ellipse& dot) const;
  std::optional<RingReading> ReadWord(const cv::Mat& grey, const RefinedEllipse& dot) const;
  std::optional<RingReading> ReadAs(const cv::Mat& grey, const RefinedEllipse& dot, const Guess& guess,
                                    double max_boost, bool is_small) const;

  int bits_;
  DotPolarity polarity_;
  std::vector<int> rotations_;  // Of each word that is read: by how many sectors its code starts later; else -1.
};

}  // namespace heba
