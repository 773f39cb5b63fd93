// The residuals between the grey values of an image and those of a blurred and illuminated pattern, and their
// derivatives by the unknowns: the inner loop of FitPattern, several pixels at a time (heba/kernels/simd.h).
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "targets/corners/cell_pattern.h"
#include "targets/corners/pattern_map.h"

namespace heba {

// The unknowns: the terms of the map, then black, white, blur (px), the gradient (2) and curvature (3) of the
// illumination, and the stretch (2) of the blur. The curvature is free with kLens and kPolynomial only. The covariance
// of the blur's Gaussian is blur^2 (1 + p, q; q, 1 - p) for the stretch (p, q), whose length must be below 1: an image
// that moved during the exposure is blurred more in one direction.
enum PatternParam {
  kBlack = PatternMap::kNumTerms,
  kWhite,
  kBlur,
  kLight,
  kLightBend = kLight + 2,
  kStretch = kLightBend + 3
};
constexpr int kNumPatternParams = kStretch + 2;
using PatternParams = Eigen::Matrix<double, kNumPatternParams, 1>;

// Returns the free parameters by increasing index.
std::vector<int> SoughtParams(MapForm form, bool is_stretch_free);

// Selects the columns of PatternSums::products.
struct PatternColumns {
  bool stretch = false;  // Whether the stretch of the blur is free.
  // Whether the derivatives by the polynomial terms and, if it is not free, by the stretch follow. For kLens only.
  bool additional = false;
};

// The lines of a pattern in unit coordinates, and the changes of albedo across them.
class UnitCells {
 public:
  UnitCells(const CellPattern& pattern, const Eigen::Vector2d& centre_m, const Eigen::Vector2d& half_m);

  // The lines near a point across which the albedo changes near it.
  struct Window {
    size_t first_x = 0;  // Cell below all lines within support_radius; the next search begins there.
    size_t first_y = 0;
    size_t num_x = 0;
    size_t num_y = 0;
    size_t x[CellPattern::kMaxLines];
    size_t y[CellPattern::kMaxLines];
  };
  // Finds the lines within the support radii of (x, y). The search begins at the previous contents of `window`.
  void FindEdgesWithin(double x, double y, double support_radius_x, double support_radius_y, Window* window) const;
  // Returns the albedo at a point without lines within support_radius.
  double AlbedoAt(const Window& window) const { return albedo_(window.first_y, window.first_x); }

  // Returns how many numbers describe a window with room for `num_x` and `num_y` lines to the kernels.
  static size_t Size(size_t num_x, size_t num_y) { return 5 + 2 * (num_x + num_y) + num_x * num_y; }
  // Writes the numbers of a window. `to` has room for Size(num_x, num_y) numbers, `stride` apart, all 0.
  void Write(const Window& window, double x, double y, size_t num_x, size_t num_y, size_t stride, double* to) const;

 private:
  // A matrix by (row of cells or line, column of cells or line), stored row by row.
  struct Table {
    size_t num_columns = 0;
    std::vector<double> values;
    explicit Table(const Eigen::MatrixXd& matrix);
    double operator()(size_t row, size_t column) const { return values[row * num_columns + column]; }
  };

  std::vector<double> x_;
  std::vector<double> y_;
  Table albedo_;
  Table step_x_;  // Change of albedo from the cell below line i to the one above it, by (row of cells, i).
  Table step_y_;  // Change of albedo across line j, by (j, column of cells).
  Table twist_;   // Mixed second difference of the four cells around the crossing of lines j and i, by (j, i).
};

// Pixels as a structure of arrays, padded to a multiple of the lanes with pixels of weight 0.
class PatternPixels {
 public:
  struct Pixel {
    double u;
    double v;
    double grey;
    double x;  // Unit coordinates under the initial guess.
    double y;
  };
  PatternPixels() = default;
  // `light_px` is the origin of the illumination's gradient, `light_size_px` its unit of length.
  PatternPixels(const std::vector<Pixel>& pixels, const Eigen::Vector2d& light_px, double light_size_px);

  size_t size() const { return size_; }

 private:
  friend class PatternRows;
  size_t size_ = 0;
  std::vector<double> u_;
  std::vector<double> v_;
  std::vector<double> light_x_;
  std::vector<double> light_y_;
  std::vector<double> grey_;
  std::vector<double> counts_;  // 1, or 0 for padding.
  std::vector<double> x_;
  std::vector<double> y_;
};

// The residuals at edges, which alone determine the position of the pattern: sums over all pixels, each weighted by
// the square of its slope (grey values per px).
struct ResidualsAtEdges {
  double weights = 0;
  double weights_squared = 0;
  double sizes = 0;
  double squares = 0;
};

// The sums over all pixels of a linearisation.
struct PatternSums {
  // Products of all pairs of columns: the derivatives of the residuals by the free parameters, the residuals and, if
  // requested, the additional derivatives; all weighted.
  Eigen::MatrixXd products;
  double cost = 0;                // Half the sum of Huber's rho, squared grey values.
  std::vector<double> residuals;  // Predicted minus observed grey value of each pixel, not weighted.
  ResidualsAtEdges at_edges;      // Weighted by Huber's loss as well.
};

struct PatternTask;

// The edges within support_radius of a group of pixels that are processed together.
struct PatternGroup {
  size_t begin;  // Index of the first number that UnitCells wrote.
  int num_x;
  int num_y;
};

class PatternRows {
 public:
  PatternRows(const CellPattern& pattern, const Eigen::Vector2d& centre_m, const Eigen::Vector2d& half_m)
      : cells_(pattern, centre_m, half_m) {}

  const UnitCells& cells() const { return cells_; }
  void SetPixels(PatternPixels pixels);
  size_t NumPixels() const { return pixels_.size(); }

  // Sums over all pixels. Returns nothing if the map cannot be inverted or the cost is not finite; the inversion
  // starts from the unit coordinates that were last kept. `huber_grey` is the Huber threshold in grey values.
  std::optional<PatternSums> Sum(const PatternMap& map, const PatternParams& params, double huber_grey,
                                 PatternColumns columns);
  // Keeps the unit coordinates of the last map as the start for the next maps, which should be near it.
  void Keep();

 private:
  // Finds the edges within support_radius of each pixel. Returns false if the map cannot be inverted.
  bool FindEdgesWithin(const PatternTask& task);

  UnitCells cells_;
  PatternPixels pixels_;
  // Unit coordinates of the pixels under the last map.
  std::vector<double> tried_x_;
  std::vector<double> tried_y_;
  std::vector<PatternGroup> groups_;  // One per vector of lanes.
  std::vector<double> numbers_;
  // Parameters at which edges were last searched for.
  std::optional<PatternParams> looked_;
};

// The blurred albedo of a pattern at `at_m` and its derivatives. `image_by_pattern` is the derivative of the map to
// the image there (px per m). The result is exact if the map is linear within the blur.
struct BlurredAlbedo {
  double value = 0;
  Eigen::Vector2d by_at = Eigen::Vector2d::Zero();  // 1/m
  double by_blur = 0;                               // 1/px
};
BlurredAlbedo Blurred(const CellPattern& pattern, const Eigen::Vector2d& at_m, const Eigen::Matrix2d& image_by_pattern,
                      double blur_sigma_px);

}  // namespace heba
