// How the grey values of a picture differ from those of a pattern, blurred and under light, and how that changes with
// what is not known of it: the inner loop of FitPattern, several pixels at a time (heba/kernels/simd.h).
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "targets/corners/cell_pattern.h"
#include "targets/corners/pattern_map.h"

namespace heba {

// The unknowns: the map's terms, then black, white, blur (px) and the light's gradient (2) and bend (3), which is
// sought with the larger forms only.
enum PatternParam { kBlack = PatternMap::kNumTerms, kWhite, kBlur, kLight, kLightBend = kLight + 2 };
constexpr int kNumPatternParams = kLightBend + 3;
using PatternParams = Eigen::Matrix<double, kNumPatternParams, 1>;

// Those that are sought, by increasing index.
std::vector<int> SoughtParams(MapForm form);

// A pattern's lines in unit coordinates, and how the albedo changes across them.
class UnitCells {
 public:
  UnitCells(const CellPattern& pattern, const Eigen::Vector2d& centre_m, const Eigen::Vector2d& half_m);

  // The lines near a point across which the albedo changes near it.
  struct Window {
    size_t first_x = 0;  // The cell below all lines within support_radius, where the next search begins.
    size_t first_y = 0;
    size_t num_x = 0;
    size_t num_y = 0;
    size_t x[CellPattern::kMaxLines];
    size_t y[CellPattern::kMaxLines];
  };
  void FindEdgesWithin(double x, double y, double support_radius_x, double support_radius_y, Window* window) const;
  // Where no line is within support_radius.
  double AlbedoAt(const Window& window) const { return albedo_(window.first_y, window.first_x); }

  // Numbers that the kernels read of a window with room for `num_x` and `num_y` lines; and those of one.
  static size_t Size(size_t num_x, size_t num_y) { return 5 + 2 * (num_x + num_y) + num_x * num_y; }
  // `to` has Size(num_x, num_y) numbers, `stride` apart, all 0.
  void Write(const Window& window, double x, double y, size_t num_x, size_t num_y, size_t stride, double* to) const;

 private:
  // By (row of cells or line, column of cells or line), row by row.
  struct Table {
    size_t num_columns = 0;
    std::vector<double> values;
    explicit Table(const Eigen::MatrixXd& matrix);
    double operator()(size_t row, size_t column) const { return values[row * num_columns + column]; }
  };

  std::vector<double> x_;
  std::vector<double> y_;
  Table albedo_;
  Table step_x_;  // From the cell below line i to the one above it, by (row of cells, i).
  Table step_y_;  // By (j, column of cells).
  Table twist_;   // Of the four cells about where lines j and i meet: what they have beyond the two steps.
};

// Pixels as a structure of arrays, padded to a multiple of the lanes with pixels that do not count.
class PatternPixels {
 public:
  struct Pixel {
    double u;
    double v;
    double grey;
    double x;  // Unit coordinates there.
    double y;
  };
  PatternPixels() = default;
  // `light_px`: what the light's gradient is taken about; it is in units of `light_size_px`.
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
  std::vector<double> counts_;  // 1, or 0 of those that pad.
  std::vector<double> x_;
  std::vector<double> y_;
};

// The residuals at edges, which alone tell where the pattern is: sums over all pixels, each of which counts by the
// square of its slope (grey values by px).
struct EdgeResiduals {
  double weights = 0;
  double weights_squared = 0;
  double sizes = 0;
  double squares = 0;
};

// The sums over all pixels of a linearisation.
struct PatternSums {
  // Of all pairs of columns: the residuals' derivatives by the sought parameters, the residuals, and, if asked for, the
  // derivatives by the polynomial's terms; all weighted.
  Eigen::MatrixXd products;
  double cost = 0;                // Half the sum of Huber's rho, grey values squared.
  std::vector<double> residuals;  // Of each pixel, what is expected less what is seen; not weighted.
  EdgeResiduals at_edges;         // Weighted by Huber too.
};

struct PatternTask;

// What is within support_radius of some pixels that are worked on at once.
struct PatternGroup {
  size_t begin;  // Of what UnitCells wrote.
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

  // Nothing where the map cannot be inverted, which begins at the pixels' unit coordinates as they were kept.
  // `huber_grey`: beyond it, deviations count less.
  std::optional<PatternSums> Sum(const PatternMap& map, const PatternParams& params, double huber_grey,
                                 bool with_polynomial);
  // The last map is near to the next ones: the pixels' unit coordinates follow it.
  void Keep();

 private:
  // What is within support_radius of each pixel. False where the map cannot be inverted.
  bool FindEdgesWithin(const PatternTask& task);

  UnitCells cells_;
  PatternPixels pixels_;
  // Of the last map.
  std::vector<double> tried_x_;
  std::vector<double> tried_y_;
  std::vector<PatternGroup> groups_;  // Of lanes.
  std::vector<double> numbers_;
  // Where it was looked for, last.
  std::optional<PatternParams> looked_;
};

// The pattern's blurred albedo at `at_m`, where the map into the picture has the derivative `image_by_pattern` (px
// per m), and its derivatives: exact for a map that is linear within the blur.
struct BlurredAlbedo {
  double value = 0;
  Eigen::Vector2d by_at = Eigen::Vector2d::Zero();  // 1/m
  double by_blur = 0;                               // 1/px
};
BlurredAlbedo Blurred(const CellPattern& pattern, const Eigen::Vector2d& at_m, const Eigen::Matrix2d& image_by_pattern,
                      double blur_sigma_px);

}  // namespace heba
