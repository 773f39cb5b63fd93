// The picture of an ellipse with a blurred edge, at many pixels at once: two surfaces under a light that is a plane,
// the inner one itself a plane, the edge between them an error function of the distance.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace heba {

// In coordinates and units of length of the caller's choice.
enum BlurredEllipseParameter {
  kCentreX,
  kCentreY,
  kShapeXX,  // Inside are the u, from the centre, with u' shape u < 1.
  kShapeXY,
  kShapeYY,
  kLogSigma,  // Of the edge's blur.
  kOutside,
  kInside,
  kLightX,  // Relative to the light at the origin.
  kLightY,
  kInsideX,
  kInsideY,
  kNumBlurredEllipseParameters
};
using BlurredEllipseParameters = Eigen::Matrix<double, kNumBlurredEllipseParameters, 1>;

// Places, grey values, and what each counts. Columns are padded for the kernels with pixels that count nothing.
class EdgePixels {
 public:
  void Clear();
  void Add(double x, double y, double grey);
  // Once all are added, which then all count 1.
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

// Of the residuals r, predicted less seen, under Huber's cost: r^2 to `huber_delta`, a line beyond.
struct BlurredEllipseSums {
  double cost = 0;
  // J'WJ and J'Wr of the first parameters; 1 on the diagonal and 0 of the others, which are held.
  Eigen::Matrix<double, kNumBlurredEllipseParameters, kNumBlurredEllipseParameters> normal;
  BlurredEllipseParameters gradient;
};
BlurredEllipseSums SumEdge(const EdgePixels& pixels, const BlurredEllipseParameters& x, int num_free,
                           double huber_delta);

// Of every pixel, whatever it counts.
std::vector<double> EdgeResiduals(const EdgePixels& pixels, const BlurredEllipseParameters& x);

}  // namespace heba
