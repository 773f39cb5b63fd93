// A model of the image of a ring of black and white sectors around a dot (ring_decoder.h), at many pixels at once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace heba {

enum RingParameter {
  kRingBoostX,  // Perspective, as the shift of the dot's centre in its plane.
  kRingBoostY,
  kRingPhase,   // Angle at which the first sector begins, rad.
  kRingScale,   // Scale of the ring relative to the dot.
  kRingBlank,   // Grey value of the blank zones.
  kRingStep,    // Grey value step from blank to the dot's colour.
  kRingLightX,  // Gradient of the light, relative to the light at the origin.
  kRingLightY,
  kNumRingParameters
};
using RingParameters = Eigen::Matrix<double, kNumRingParameters, 1>;

// A word of `bits` sectors; its highest bit is the first sector.
struct RingWord {
  uint32_t word = 0;
  int bits = 0;

  // Returns the bit of a sector, from -1 to bits.
  double Bit(int sector) const { return (word >> (bits - 1 - (sector + bits) % bits)) & 1U ? 1 : 0; }
};

// The position of a pixel relative to the dot's centre, in radii of the dot, and its grey value.
struct RingPixel {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double grey = 0;
};

// Pixels in columns for the SIMD kernels, each with the edges of the sector that contains it.
class RingPixels {
 public:
  // Takes every `stride`-th of `pixels`. Sectors are assigned by `ring_from_place`, which maps positions of pixels to
  // the ring's plane, both in radii of the dot.
  RingPixels(const std::vector<RingPixel>& pixels, size_t stride, const Eigen::Matrix3d& ring_from_place,
             const RingWord& word);

  size_t size() const { return size_; }
  // Returns the angle of each pixel in the ring, in turns, in [0, 1).
  const std::vector<double>& turns() const { return turns_; }
  // Columns of the same length, a multiple of kMaxLanes; pixels of zero weight pad the end.
  enum Column { kX, kY, kGrey, kWeight, kHere, kBefore, kAfter, kFirstX, kFirstY, kLastX, kLastY, kNumColumns };
  const double* column(Column column) const { return columns_[column].data(); }
  int padded_size() const { return static_cast<int>(columns_[kX].size()); }

 private:
  size_t size_ = 0;
  std::vector<double> turns_;
  std::array<std::vector<double>, kNumColumns> columns_;
};

// The map of a ring, its derivatives with respect to boost and phase, and its blur (sigma in radii of the dot).
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
// Sums over the residuals r, predicted minus observed in units of `unit` (grey levels), under Huber's loss: r^2 up to
// `huber_delta`, linear beyond.
RingSums SumRing(const RingPixels& pixels, const RingMap& map, const RingParameters& x, double unit,
                 double huber_delta);

struct RingResidual {
  double residual = 0;  // Predicted minus observed, relative to the light and the step.
  double radius = 0;    // Radius in the ring's plane.
};
std::vector<RingResidual> RingResiduals(const RingPixels& pixels, const RingMap& map, const RingParameters& x);

}  // namespace heba
