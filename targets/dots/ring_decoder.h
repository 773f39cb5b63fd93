// Reads the ring of black and white sectors around a dot. In radii of the dot, the ring extends from 2 to 3, and the
// zones from 1 to 2 and from 3 to 3.5 are blank. Anything else is not read.
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
  // Homography from the ring's plane, in radii of the dot: x points along the first edge of the sector that is the
  // highest bit of the code, y a quarter turn further in the direction of reading. It is scaled so that points in
  // front have w > 0.
  Eigen::Matrix3d pixel_from_ring = Eigen::Matrix3d::Identity();
  double residual_ratio = 0;  // RMS difference between the image and the modelled ring, divided by the contrast.
  // Whether the ring is large and exact enough to be trusted on its own. Some of the other readings are accidental: a
  // small ring with one black sector may be a dot with a spot beside it.
  bool is_clear = false;
};

class RingDecoder {
 public:
  // Prepares to read the codes in `codes`.
  RingDecoder(int bits, DotPolarity polarity, const std::vector<uint32_t>& codes);

  struct Guess;

  // Reads the ring around a dot found by FindEllipses. Returns nothing if there is no ring or its code is not in the
  // list. `grey` is CV_8UC1.
  std::optional<RingReading> Read(const cv::Mat& grey, const Ellipse& candidate) const;

  // The two steps of Read, for rings of several sizes around one dot: MayRead rules out most dots without a fit, and
  // ReadAround reads the ring around the dot as FitDot has fitted it, which is the same for all sizes of rings.
  bool MayRead(const cv::Mat& grey, const Ellipse& candidate) const;
  std::optional<RefinedEllipse> FitDot(const cv::Mat& grey, const Ellipse& candidate) const;
  std::optional<RingReading> ReadAround(const cv::Mat& grey, const RefinedEllipse& dot) const;

  // The least radius, along the shorter axis, of a dot about which IsLikely can tell.
  static constexpr double kLeastLikelyRadiusPx = 4;
  // Returns whether Read is likely to find one of the codes: true for large rings with clear sectors, judged without
  // a fit.
  bool IsLikely(const cv::Mat& grey, const Ellipse& candidate) const;

 private:
  bool IsAlone(const cv::Mat& grey, const Ellipse& dot) const;
  std::optional<RingReading> ReadAs(const cv::Mat& grey, const RefinedEllipse& dot, const Guess& guess,
                                    double max_boost, bool is_small) const;

  int bits_;
  DotPolarity polarity_;
  // Number of sectors by which the code starts later, for each word that is read; else -1.
  std::vector<int> rotations_;
};

}  // namespace heba
