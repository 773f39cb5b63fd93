// The picture of a ring of black and white sectors about a dot (ring_decoder.h), at many pixels at once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace heba {

enum RingParameter {
  kRingBoostX,  // Perspective, as the shift of the dot's centre in its plane.
  kRingBoostY,
  kRingPhase,   // Where the first sector begins, rad.
  kRingScale,   // Of the ring beside the dot.
  kRingBlank,   // Grey values: without the dot's colour,
  kRingStep,    // what that adds,
  kRingLightX,  // and the light, relative to that at the origin.
  kRingLightY,
  kNumRingParameters
};
using RingParameters = Eigen::Matrix<double, kNumRingParameters, 1>;

// The word of `bits` sectors, the first one its highest bit.
struct RingWord {
  uint32_t word = 0;
  int bits = 0;

  // Of a sector from -1 to bits.
  double Bit(int sector) const { return (word >> (bits - 1 - (sector + bits) % bits)) & 1U ? 1 : 0; }
};

// Where pixels are, from the dot's centre in its radii, and what is seen there.
struct RingPixel {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double grey = 0;
};

// Pixels in columns for the kernels, each with the edges of the sector that it is in.
class RingPixels {
 public:
  // Of `pixels` each `stride`-th, sectors as `ring_from_place` (ring's plane in radii of the dot, from places) has
  // them.
  RingPixels(const std::vector<RingPixel>& pixels, size_t stride, const Eigen::Matrix3d& ring_from_place,
             const RingWord& word);

  size_t size() const { return size_; }
  // Of each pixel: its angle in the ring in turns, in [0, 1).
  const std::vector<double>& turns() const { return turns_; }
  // Columns of the same length, a multiple of kMaxLanes: pixels that do not count follow at the end.
  enum Column { kX, kY, kGrey, kWeight, kHere, kBefore, kAfter, kFirstX, kFirstY, kLastX, kLastY, kNumColumns };
  const double* column(Column column) const { return columns_[column].data(); }
  int padded_size() const { return static_cast<int>(columns_[kX].size()); }

 private:
  size_t size_ = 0;
  std::vector<double> turns_;
  std::array<std::vector<double>, kNumColumns> columns_;
};

// A ring's map, its derivatives by boost and phase, and its blur (standard deviation in radii of the dot).
struct RingMap {
  Eigen::Matrix3d ring_from_place;
  std::array<Eigen::Matrix3d, 3> derivatives;
  double sigma = 0;
};

struct RingSums {
  double cost = 0;
  Eigen::Matrix<double, kNumRingParameters, kNumRingParameters> normal;  // J'WJ
  RingParameters gradient;                                               // J'Wr
};
// Of the residuals r, predicted less seen by `unit` (grey levels), under Huber's cost: r^2 to `huber_delta`, a line
// beyond.
RingSums SumRing(const RingPixels& pixels, const RingMap& map, const RingParameters& x, double unit,
                 double huber_delta);

struct RingResidual {
  double residual = 0;  // Predicted less seen, by the light and the step.
  double radius = 0;    // In the ring's plane.
};
std::vector<RingResidual> RingResiduals(const RingPixels& pixels, const RingMap& map, const RingParameters& x);

}  // namespace heba
