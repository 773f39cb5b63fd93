// A model of the image of an ellipse with a blurred edge, evaluated at many pixels at once: two surfaces under a
// light that varies linearly, the grey value of the inner one varying linearly too, and an edge between them that is
// an error function of the distance.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Parameters of the model, in coordinates and units of length of the caller's choice.
enum BlurredEllipseParameter {
  kCentreX,
  kCentreY,
  kShapeXX,  // Points u, relative to the centre, with u' shape u < 1 are inside.
  kShapeXY,
  kShapeYY,
  kLogSigma,  // Logarithm of the sigma of the edge's blur.
  kOutside,
  kInside,
  kLightX,  // Gradient of the light, relative to the light at the origin.
  kLightY,
  kInsideX,
  kInsideY,
  kNumBlurredEllipseParameters
};
using BlurredEllipseParameters = Eigen::Matrix<double, kNumBlurredEllipseParameters, 1>;

// Positions, grey values and weights of pixels. Columns are padded for the SIMD kernels with pixels of zero weight.
class EdgePixels {
 public:
  void Clear();
  void Add(double x, double y, double grey);
  // Pads the columns and sets all weights to 1; called once all pixels have been added.
  void Pad();

  size_t size() const { return size_; }
  const std::vector<double>& x() const { return x_; }
  const std::vector<double>& y() const { return y_; }
  const std::vector<double>& grey() const { return grey_; }
  const std::vector<double>& weights() const { return weights_; }
  void SetWeight(size_t i, double weight) { weights_[i] = weight; }

 private:
  size_t size_ = 0;
  std::vector<double> x_;
  std::vector<double> y_;
  std::vector<double> grey_;
  std::vector<double> weights_;
};

// Sums over the residuals r, predicted minus observed, under Huber's loss: r^2 up to `huber_delta`, linear beyond.
struct BlurredEllipseSums {
  double cost = 0;
  // J'WJ and J'Wr of the first `num_free` parameters. The others are held: 1 on the diagonal, 0 elsewhere.
  Eigen::Matrix<double, kNumBlurredEllipseParameters, kNumBlurredEllipseParameters> normal;
  BlurredEllipseParameters gradient;
};
BlurredEllipseSums SumEdge(const EdgePixels& pixels, const BlurredEllipseParameters& x, int num_free,
                           double huber_delta);

// Returns the residuals of all pixels, regardless of their weights.
std::vector<double> EdgeResiduals(const EdgePixels& pixels, const BlurredEllipseParameters& x);

}  // namespace heba
