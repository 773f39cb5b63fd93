#include "tools/pipeline/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "heba/base/factorisation.h"
#include "heba/base/median.h"
#include "heba/base/text.h"

namespace heba {
namespace {

constexpr int kHalfWindowPx = 6;

// Returns one sigma of the blur around one point; nothing if it is too close to the border, or too faint.
std::optional<double> BlurAround(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  const int column = static_cast<int>(std::lround(pixel.x()));
  const int row = static_cast<int>(std::lround(pixel.y()));
  const int reach = kHalfWindowPx + 1;
  if (column < reach || row < reach || column >= grey.cols - reach || row >= grey.rows - reach) return std::nullopt;
  std::vector<double> values;
  std::array<double, 2> steepest = {0, 0};
  for (int v = row - kHalfWindowPx; v <= row + kHalfWindowPx; ++v) {
    const auto* const here = grey.ptr<unsigned char>(v);
    const auto* const after = grey.ptr<unsigned char>(v + 1);
    for (int u = column - kHalfWindowPx; u <= column + kHalfWindowPx; ++u) {
      values.push_back(here[u]);
      steepest[0] = std::max(steepest[0], 1.0 * std::abs(here[u + 1] - here[u]));
      steepest[1] = std::max(steepest[1], 1.0 * std::abs(after[u] - here[u]));
    }
  }
  // The darkest and the brightest twentieth are noise.
  std::sort(values.begin(), values.end());
  const size_t margin = values.size() / 20;
  const double contrast = values[values.size() - 1 - margin] - values[margin];
  constexpr double kFaintest = 20;
  if (contrast < kFaintest) return std::nullopt;
  const double least = std::min(steepest[0], steepest[1]);
  return contrast / (std::sqrt(2 * std::numbers::pi) * std::max(least, 1.0));
}

// Returns by how much the image of a flat target is shorter in one direction than in the other, as a share; nothing if
// the points do not tell.
std::optional<double> ForeshorteningOf(const Observations& observations) {
  constexpr int kFewestPoints = 4;
  const Eigen::Index n = observations.size();
  if (n < kFewestPoints) return std::nullopt;
  Eigen::MatrixXd places(n, 3);
  places << observations.points_in_target.topRows<2>().transpose(), Eigen::VectorXd::Ones(n);
  const Eigen::MatrixXd square = places.transpose() * places;
  const auto factor = Cholesky(square);
  if (!factor) return std::nullopt;
  const Eigen::MatrixXd affine =
      factor->Solve(Eigen::MatrixXd(places.transpose() * observations.pixels.transpose())).topRows<2>();
  const auto eigen = EigenOfSymmetric(Eigen::MatrixXd(affine.transpose() * affine));
  const double largest = eigen.values.maxCoeff();
  if (!(largest > 0)) return std::nullopt;
  return 1 - std::sqrt(std::max(0.0, eigen.values.minCoeff()) / largest);
}

}  // namespace

std::string ExposureText(const cv::Mat& grey) {
  double num_bright = 0;
  double sum = 0;
  for (int row = 0; row < grey.rows; ++row) {
    const auto* const pixels = grey.ptr<unsigned char>(row);
    for (int column = 0; column < grey.cols; ++column) {
      constexpr unsigned char kSaturated = 254;
      num_bright += pixels[column] >= kSaturated ? 1 : 0;
      sum += pixels[column];
    }
  }
  const double num_pixels = static_cast<double>(grey.rows) * grey.cols;
  constexpr double kMostBright = 0.2;
  constexpr double kDark = 30;
  if (num_bright > kMostBright * num_pixels) {
    return "overexposed: " + Fixed(100 * num_bright / num_pixels, 0) + " % of its pixels are white";
  }
  if (sum < kDark * num_pixels) return "dark: its mean is " + Fixed(sum / num_pixels, 0) + " of 255";
  return "";
}

std::optional<double> BlurPx(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<double> blurs;
  for (const Eigen::Vector2d& pixel : pixels) {
    if (const std::optional<double> blur_px = BlurAround(grey, pixel)) blurs.push_back(*blur_px);
  }
  constexpr size_t kFewest = 4;
  if (blurs.size() < kFewest) return std::nullopt;
  return Median(blurs);
}

std::string SharpnessText(double blur_px, double sharpest_px) {
  // Points are found in such images, but not as well; a hand or an arm that still moves does it.
  constexpr double kBlurredPx = 2.5;
  constexpr double kMuch = 1.6;
  if (blur_px < kBlurredPx && blur_px < kMuch * sharpest_px) return "";
  return "blurred: its edges have a sigma of " + Fixed(blur_px, 1) + " px" +
         (sharpest_px < blur_px ? " (" + Fixed(sharpest_px, 1) + " px in the sharpest image)" : "");
}

Gauges GaugesOf(const std::vector<SeenTarget>& seen) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1);
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  double foreshortening = 0;
  for (const SeenTarget& target : seen) {
    const Points2& pixels = target.observations.pixels;
    if (pixels.cols() == 0) continue;
    const Eigen::Vector2d mean = pixels.rowwise().mean();
    const Eigen::Vector2d extent = pixels.rowwise().maxCoeff() - pixels.rowwise().minCoeff();
    const double area_px2 = static_cast<double>(target.width_px) * target.height_px;
    const Eigen::Vector3d place(mean.x() / target.width_px, mean.y() / target.height_px,
                                std::sqrt(extent.prod() / area_px2));
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
    foreshortening = std::max(foreshortening, ForeshorteningOf(target.observations).value_or(0));
  }
  const Eigen::Vector3d range = (high - low).cwiseMax(0);
  // The middle of the target should move over these parts of the image, as in hand-held calibrations, and the target
  // be tilted by 37 deg once.
  constexpr double kOfImage = 0.5;
  constexpr double kOfSize = 0.25;
  constexpr double kForeshortened = 0.2;
  return {std::min(1.0, range.x() / kOfImage), std::min(1.0, range.y() / kOfImage), std::min(1.0, range.z() / kOfSize),
          std::min(1.0, foreshortening / kForeshortened)};
}

}  // namespace heba
