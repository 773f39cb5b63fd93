#include "targets/corners/pattern_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/levenberg_marquardt.h"
#include "heba/base/median.h"
#include "heba/geometry/homography.h"
#include "targets/corners/pattern_map.h"
#include "targets/corners/pattern_rows.h"

namespace heba {
namespace {

MapForm FormOf(MapFreedom freedom) {
  switch (freedom) {
    case MapFreedom::kAffine:
      return MapForm::kAffine;
    case MapFreedom::kQuadratic:
      return MapForm::kQuadratic;
    case MapFreedom::kStrongLens:
      return MapForm::kLens;
  }
  return MapForm::kLens;
}

// Returns the centre of the whole image, in pixels of `grey`, which may be a part of it.
Eigen::Vector2d LensPx(const cv::Mat& grey) {
  cv::Size whole;
  cv::Point offset;
  grey.locateROI(whole, offset);
  return {0.5 * (whole.width - 1) - offset.x, 0.5 * (whole.height - 1) - offset.y};
}

PatternMap StartMap(const Eigen::Matrix3d& image_from_unit, MapForm form, const Eigen::Vector2d& lens_px) {
  PatternMap map;
  map.form = form;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) map.start[row][column] = image_from_unit(row, column);
  }
  const Eigen::Vector2d middle_px = ApplyHomography(image_from_unit, Eigen::Vector2d::Zero());
  const Eigen::Vector2d right_px = ApplyHomography(image_from_unit, Eigen::Vector2d(1, 0));
  const Eigen::Vector2d below_px = ApplyHomography(image_from_unit, Eigen::Vector2d(0, 1));
  map.size_px = std::max({1.0, (right_px - middle_px).norm(), (below_px - middle_px).norm()});
  map.lens_radius_px = std::max(1.0, lens_px.norm());
  for (int axis = 0; axis < 2; ++axis) {
    map.middle_px[axis] = middle_px[axis];
    map.lens_px[axis] = lens_px[axis];
  }
  return map;
}

// The lower bound of the blur: the standard deviation of a pixel's box. A sharper image is not integrated over the
// pixels' areas, and its edges then lie, on average, where the pixels near them indicate.
constexpr double kMinBlurPx = 0.2886751345948129;

constexpr double kCorners[][2] = {{-1, -1}, {-1, 1}, {1, -1}, {1, 1}};

// Returns the displacements per unit of the free terms, one column per term.
Eigen::Matrix2Xd DisplacementsAt(const PatternMap& map, const Eigen::Vector2d& unit) {
  Eigen::Matrix2Xd displacements = Eigen::Matrix2Xd::Zero(2, PatternMap::kNumTerms);
  Eigen::Index column = 0;
  ForEachDisplacement(
      map, unit.x(), unit.y(), [&](double px) { displacements(0, column++) = px; },
      [&](double px) { displacements(1, column++) = px; },
      [&](double u_px, double v_px) { displacements.col(column++) << u_px, v_px; });
  return displacements.leftCols(column);
}

class Fitter {
 public:
  Fitter(const cv::Mat& grey, const CellPattern& pattern, const Eigen::Matrix3d& start,
         const PatternFitOptions& options)
      : centre_m_(0.5 * (options.min_m + options.max_m)),
        half_m_(0.5 * (options.max_m - options.min_m)),
        rows_(pattern, centre_m_, half_m_) {
    Eigen::Matrix3d pattern_from_unit = Eigen::Matrix3d::Identity();
    pattern_from_unit.diagonal().head<2>() = half_m_;
    pattern_from_unit.topRightCorner<2, 1>() = centre_m_;
    const Eigen::Matrix3d image_from_unit = start * pattern_from_unit;
    map_ = StartMap(image_from_unit, FormOf(options.freedom), LensPx(grey));
    sought_ = SoughtParams(map_.form, false);
    if (map_.form == MapForm::kQuadratic) ExpectSquares(options);
    is_usable_ = CollectPixels(grey, image_from_unit) && StartLevels();
  }

  bool is_usable() const { return is_usable_; }
  double param(PatternParam which) const { return params_[which]; }
  double contrast() const { return params_[kWhite] - params_[kBlack]; }
  Eigen::Vector2d UnitOf(const Eigen::Vector2d& at_m) const { return (at_m - centre_m_).cwiseQuotient(half_m_); }
  Eigen::Vector2d PixelAt(const Eigen::Vector2d& unit) const {
    const MappedPoint<double> point = MapPoint(map_, params_.data(), unit.x(), unit.y());
    return {point.u, point.v};
  }
  // Returns the pixel's derivative by the free parameters.
  Eigen::Matrix2Xd PixelDerivative(const Eigen::Vector2d& unit) const {
    Eigen::Matrix2Xd derivative = Eigen::Matrix2Xd::Zero(2, NumSought());
    const Eigen::Matrix2Xd displacements = DisplacementsAt(map_, unit);
    derivative.leftCols(displacements.cols()) = displacements;
    return derivative;
  }

  // Solves by least squares first, then with Huber's loss. Returns false if a step or the map cannot be computed.
  bool Solve() {
    constexpr SmallStep kRough = {0.02, 1};
    constexpr double kLeastSquares = std::numeric_limits<double>::infinity();
    const std::optional<PatternSums> start = rows_.Sum(map_, params_, kLeastSquares, {});
    if (!start) return false;
    noise_grey_ = std::sqrt(2 * start->cost / Dof());
    if (!Descend(EquationsOf(*start), kLeastSquares, kRough)) return false;
    constexpr double kHuber = 2.5;
    constexpr double kMinNoiseGrey = 0.3;  // Rounding noise of a pixel.
    // Misfit at the edges of a sharp image counts as noise: if all of it were outliers, the position would be
    // unknown.
    noise_grey_ = std::max({kMinNoiseGrey, NoiseOf(result_.residuals), MeanNoiseOf(result_.at_edges)});
    const double huber_grey = kHuber * noise_grey_;
    std::optional<Equations> here =
        map_.form == MapForm::kLens ? FreeWhatIsRequired(huber_grey) : Linearise(huber_grey);
    constexpr SmallStep kFine = {2e-3, 0.1};
    return here && Descend(std::move(*here), huber_grey, kFine);
  }

  // Returns the sigma of one grey value, corrected for the degrees of freedom.
  double noise_grey() const { return std::sqrt(2 * result_.cost / Dof()); }
  double OutlierShare() const {
    const double limit_grey = contrast() / 3;
    const auto num = std::count_if(result_.residuals.begin(), result_.residuals.end(),
                                   [&](double residual) { return std::abs(residual) > limit_grey; });
    return static_cast<double>(num) / static_cast<double>(result_.residuals.size());
  }
  // Returns the covariance of the free parameters.
  Eigen::MatrixXd Covariance() const {
    return std::max(2 * result_.cost / Dof(), SignificantVarianceOf(result_.at_edges)) *
           SolveSymmetric(result_.normal, Eigen::MatrixXd::Identity(NumSought(), NumSought()));
  }

 private:
  // The normal equations of the free parameters at `params`.
  struct Equations {
    PatternParams params;
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
    double cost = 0;  // Half the sum of Huber's rho.
    std::vector<double> residuals;
    ResidualsAtEdges at_edges;
  };

  Eigen::Index NumSought() const { return static_cast<Eigen::Index>(sought_.size()); }
  double Dof() const {
    return std::max(1.0, static_cast<double>(rows_.NumPixels()) - static_cast<double>(NumSought()));
  }

  // The thresholds of convergence. Either one is sufficient.
  struct SmallStep {
    double move_px;
    double sigmas;  // Mahalanobis length of the step, given the noise.
  };

  // Minimises the cost until the steps are negligible. Returns false if a step is not finite.
  bool Descend(Equations here, double huber_grey, const SmallStep& small) {
    LevenbergMarquardtOptions options;
    options.max_tries = 30;
    options.least_damping = 1e-7;
    options.most_damping = 3e3;
    options.small_drop = 0;
    const auto moved = [&](PatternParams params, const Eigen::VectorXd& step) {
      for (size_t k = 0; k < sought_.size(); ++k) params[sought_[k]] += step[static_cast<Eigen::Index>(k)];
      params[kBlur] = std::max(params[kBlur], kMinBlurPx);
      return params;
    };
    const auto try_step = [&](const Equations& from, const Eigen::VectorXd& step) {
      params_ = moved(from.params, step);
      std::optional<Equations> there = IsPossible() ? Linearise(huber_grey) : std::nullopt;
      if (there) there = WithBlurHeld(std::move(*there));
      if (there && there->cost <= from.cost) rows_.Keep();  // The step is taken; the next maps are near this one.
      return there;
    };
    // Convergence is judged by the undamped step: damping shortens steps along poorly determined directions.
    Eigen::VectorXd whole;
    bool has_converged = false;
    const auto stops_at = [&](const Equations& at) {
      whole = SolveSymmetric(at.normal, -at.gradient);
      if (!whole.allFinite()) return true;
      const double variance = 2 * at.cost / Dof();
      const double move_px = LargestMovePx(whole);
      // A move larger than this must be evaluated, however uncertain it is.
      constexpr double kMostUnseenPx = 0.3;
      const bool is_in_noise =
          move_px < kMostUnseenPx && -at.gradient.dot(whole) < small.sigmas * small.sigmas * variance;
      has_converged = move_px < small.move_px || is_in_noise;
      return has_converged;
    };
    result_ = WithBlurHeld(std::move(here));
    const bool is_finite = stops_at(result_) || MinimiseSquares(options, try_step, &result_, stops_at).is_finite;
    params_ = result_.params;
    if (has_converged) {
      // The error that remains is quadratic in the step.
      params_ = moved(result_.params, whole);
      if (!IsPossible()) params_ = result_.params;
    }
    return is_finite && whole.allFinite();
  }

  // Returns the equations without the blur if it is at its lower bound and would decrease further.
  Equations WithBlurHeld(Equations equations) const {
    if (equations.params[kBlur] > kMinBlurPx) return equations;
    const Eigen::Index blur = std::find(sought_.begin(), sought_.end(), kBlur) - sought_.begin();
    if (equations.gradient[blur] <= 0) return equations;
    equations.gradient[blur] = 0;
    equations.normal.row(blur).setZero();
    equations.normal.col(blur).setZero();
    equations.normal(blur, blur) = 1;
    return equations;
  }

  // Frees the stretch of the blur, and replaces perspective and lens by squares and cubes, and linearises. Each is done
  // if the grey values require it: if the cost would decrease by more than chance allows (2 sigma of the chi-square
  // distribution of the added parameters).
  std::optional<Equations> FreeWhatIsRequired(double huber_grey) {
    const std::optional<PatternSums> sums = rows_.Sum(map_, params_, huber_grey, {is_stretch_free_, true});
    if (!sums) return std::nullopt;
    const Eigen::Index num_sought = NumSought();
    const Eigen::Index num_columns = sums->products.cols();
    Equations narrow = EquationsOf(*sums);
    std::vector<Eigen::Index> columns;
    for (Eigen::Index k = 0; k < num_sought; ++k) columns.push_back(k);
    double fall = MahalanobisSquare(narrow.gradient, narrow.normal);
    // Returns whether other columns are required, which then become those of the next question.
    const auto are_required = [&](const std::vector<Eigen::Index>& wide) {
      const Eigen::MatrixXd normal = sums->products(wide, wide);
      const double wide_fall = MahalanobisSquare(sums->products(wide, num_sought), normal);
      const double variance = std::max(2 * narrow.cost - wide_fall, 0.0) / Dof();
      const auto num_added = static_cast<double>(wide.size()) - static_cast<double>(columns.size());
      if (!(wide_fall - fall > variance * (num_added + 2 * std::sqrt(2.0 * num_added)))) return false;
      fall = wide_fall;
      columns = wide;
      return true;
    };
    std::vector<Eigen::Index> wide = columns;
    wide.insert(wide.end(), {num_columns - 2, num_columns - 1});
    is_stretch_free_ = are_required(wide);
    wide.clear();
    for (const Eigen::Index k : columns) {
      if (!(k >= PatternMap::kPerspective && k < PatternMap::kPolynomial)) wide.push_back(k);
    }
    for (Eigen::Index k = 0; k < 2 * PatternMap::kNumPolynomial; ++k) wide.push_back(num_sought + 1 + k);
    if (are_required(wide)) map_.form = MapForm::kPolynomial;
    if (static_cast<Eigen::Index>(columns.size()) == num_sought) return narrow;
    sought_ = SoughtParams(map_.form, is_stretch_free_);
    return Linearise(huber_grey);
  }

  std::optional<Equations> Linearise(double huber_grey) {
    const std::optional<PatternSums> sums = rows_.Sum(map_, params_, huber_grey, {is_stretch_free_, false});
    if (!sums) return std::nullopt;
    return EquationsOf(*sums);
  }

  Equations EquationsOf(const PatternSums& sums) const {
    const Eigen::Index n = NumSought();
    Equations equations{
        params_,      sums.products.topLeftCorner(n, n), sums.products.col(n).head(n), sums.cost, sums.residuals,
        sums.at_edges};
    const auto expect = [&](Eigen::Index first, Eigen::Index end, double sigma) {
      const double weight = std::pow(noise_grey_ / sigma, 2);
      for (Eigen::Index k = first; k < end; ++k) {
        const int param = sought_[static_cast<size_t>(k)];
        const double term = params_[param] - expected_[param];
        equations.normal(k, k) += weight;
        equations.gradient[k] += weight * term;
        equations.cost += 0.5 * weight * term * term;
      }
    };
    // A pattern near the image centre neither determines nor needs the lens. The two lens terms are displacements at
    // a distance of lens_radius_px from the centre; their sigma is that distance.
    if (map_.form == MapForm::kLens) expect(PatternMap::kLens, PatternMap::kPolynomial, map_.lens_radius_px);
    // If few edges are visible, most terms other than shifts move pixels only along these edges. A weak expectation
    // keeps such terms determined.
    constexpr double kLargeStretch = 0.1;
    if (map_.form == MapForm::kAffine || map_.form == MapForm::kQuadratic) {
      expect(1, 3, kLargeStretch * map_.size_px);
      expect(4, PatternMap::kNumAffine, kLargeStretch * map_.size_px);
    }
    if (map_.form == MapForm::kQuadratic) {
      expect(PatternMap::kNumAffine, PatternMap::kNumAffine + 2 * PatternMap::kNumSquares, squares_sigma_px_);
    }
    if (is_stretch_free_) expect(n - 2, n, 1);
    return equations;
  }

  // Sets the expected squares and starts from them.
  void ExpectSquares(const PatternFitOptions& options) {
    constexpr double kLargeSquare = 0.05;
    squares_sigma_px_ = options.squares_sigma_px > 0 ? options.squares_sigma_px : kLargeSquare * map_.size_px;
    for (int axis = 0; axis < 2; ++axis) {
      expected_.segment<PatternMap::kNumSquares>(PatternMap::kPolynomial + axis * PatternMap::kNumPolynomial) =
          options.squares_px.row(axis).transpose();
    }
    params_ = expected_;
  }

  // Returns the largest move of a corner of the pattern along u or v.
  double LargestMovePx(const Eigen::VectorXd& step) const {
    double largest_px = 0;
    for (const auto& corner : kCorners) {
      const Eigen::Matrix2Xd displacements = DisplacementsAt(map_, {corner[0], corner[1]});
      largest_px = std::max(largest_px, (displacements * step.head(displacements.cols())).cwiseAbs().maxCoeff());
    }
    return largest_px;
  }

  // Returns false if there are too few pixels, or too many of them lie outside the image.
  bool CollectPixels(const cv::Mat& grey, const Eigen::Matrix3d& image_from_unit) {
    // Pixels away from edges determine only the two levels: few of them suffice.
    constexpr double kEdgeReachPx = 3.7;
    constexpr int kFlatShare = 7;
    const Eigen::Matrix3d unit_from_image = image_from_unit.inverse();
    Eigen::Array2d low = Eigen::Array2d::Constant(1e9);
    Eigen::Array2d high = -low;
    Eigen::Vector2d support_radius = Eigen::Vector2d::Zero();  // Largest one at a corner of the pattern.
    for (const auto& corner : kCorners) {
      const Eigen::Vector2d unit(corner[0], corner[1]);
      const Eigen::Vector2d at_px = ApplyHomography(image_from_unit, unit);
      if (!at_px.allFinite()) return false;
      low = low.min(at_px.array());
      high = high.max(at_px.array());
      const Eigen::Matrix2d by_px =
          (unit_from_image.topLeftCorner<2, 2>() - unit * unit_from_image.bottomLeftCorner<1, 2>()) /
          unit_from_image.row(2).dot(at_px.homogeneous());
      support_radius = support_radius.cwiseMax(kEdgeReachPx * by_px.rowwise().norm());
    }
    constexpr double kMaxSizePx = 2000;
    const Eigen::Array2d size_px = high - low;
    if (!(size_px < kMaxSizePx).all()) return false;
    // Every second, third, ... pixel of a large pattern is enough.
    constexpr double kEnoughPixels = 30000;
    const int step = 1 + static_cast<int>(std::sqrt(size_px.prod() / kEnoughPixels));
    const int stride = step * step;
    // The third homogeneous coordinate changes its sign beyond the horizon.
    const double front = image_from_unit(2, 2);
    // Pixels by the numbers of lines near them along x and y: pixels of one kind are processed together.
    constexpr size_t kMostLines = 4;
    std::vector<PatternPixels::Pixel> kinds[kMostLines + 1][kMostLines + 1];
    UnitCells::Window window;
    int num_outside = 0;
    size_t num_inside = 0;
    const int first_u = static_cast<int>(std::floor(low.x()));
    const int last_u = static_cast<int>(std::ceil(high.x()));
    for (int v = static_cast<int>(std::floor(low.y())); v <= static_cast<int>(std::ceil(high.y())); ++v) {
      const Eigen::Vector3d row_begin = unit_from_image.col(1) * v + unit_from_image.col(2);
      for (int u = first_u + (stride > 1 ? v * 5 % stride : 0); u <= last_u; u += stride) {
        const Eigen::Vector3d q = row_begin + unit_from_image.col(0) * u;
        const Eigen::Vector2d unit = q.head<2>() * (1 / q.z());
        if (!(std::abs(unit.x()) <= 1 && std::abs(unit.y()) <= 1 && q.z() * front > 0)) continue;
        if (u < 0 || v < 0 || u >= grey.cols || v >= grey.rows) {
          ++num_outside;
          continue;
        }
        rows_.cells().FindEdgesWithin(unit.x(), unit.y(), support_radius.x(), support_radius.y(), &window);
        if (window.num_x + window.num_y == 0) {
          AddFlat(rows_.cells().AlbedoAt(window), grey.at<uchar>(v, u));
          if ((u + 3 * v) % kFlatShare != 0) continue;
        }
        kinds[std::min(window.num_x, kMostLines)][std::min(window.num_y, kMostLines)].push_back(
            {static_cast<double>(u), static_cast<double>(v), static_cast<double>(grey.at<uchar>(v, u)), unit.x(),
             unit.y()});
        ++num_inside;
      }
    }
    // More pixels would take more time and hardly improve the precision.
    constexpr size_t kMaxPixels = 6000;
    const size_t share = num_inside / kMaxPixels + 1;
    std::vector<PatternPixels::Pixel> pixels;
    pixels.reserve(num_inside / share + 1);
    size_t next = 0;
    for (const auto& row : kinds) {
      for (const auto& kind : row) {
        for (const PatternPixels::Pixel& pixel : kind) {
          if (next++ % share == 0) pixels.push_back(pixel);
        }
      }
    }
    if (!(pixels.size() > 2 * static_cast<size_t>(NumSought()) && 4 * num_outside < static_cast<int>(pixels.size()))) {
      return false;
    }
    rows_.SetPixels(PatternPixels(pixels, ApplyHomography(image_from_unit, Eigen::Vector2d::Zero()),
                                  0.5 * std::max(1.0, size_px.maxCoeff())));
    return true;
  }

  // Adds the equation of a pixel away from edges to the normal equations of the two levels.
  void AddFlat(double albedo, double grey) {
    const Eigen::Vector2d by_levels(1 - albedo, albedo);
    flat_normal_ += by_levels * by_levels.transpose();
    flat_right_ += grey * by_levels;
  }

  // Initialises the blur by a guess, and the levels by least squares: from the pixels away from edges if there are
  // enough, from all pixels otherwise.
  bool StartLevels() {
    constexpr double kStartBlurPx = 0.9;
    params_[kBlur] = kStartBlurPx;
    constexpr double kEnoughFlat = 20;
    if (flat_normal_.diagonal().minCoeff() >= kEnoughFlat) {
      params_.segment<2>(kBlack) = SolveSymmetric(flat_normal_, flat_right_);
      if (params_[kWhite] > params_[kBlack]) return true;
    }
    params_[kBlack] = 0;
    params_[kWhite] = 1;
    const std::optional<PatternSums> sums = rows_.Sum(map_, params_, std::numeric_limits<double>::infinity(), {});
    if (!sums) return false;
    const Eigen::Index residual = NumSought();
    const Eigen::Index black = std::find(sought_.begin(), sought_.end(), kBlack) - sought_.begin();
    const Eigen::Matrix2d normal = sums->products.block<2, 2>(black, black);
    params_.segment<2>(kBlack) -= SolveSymmetric(normal, sums->products.col(residual).segment<2>(black));
    return params_.allFinite();
  }

  bool IsPossible() const {
    constexpr double kMostStretch = 0.97;
    return params_.allFinite() && params_[kBlur] < 20 && params_[kWhite] > params_[kBlack] &&
           params_.segment<kStretch - kLight>(kLight).cwiseAbs().maxCoeff() < 1 &&
           params_.segment<2>(kStretch).norm() < kMostStretch;
  }

  // Returns sigma as estimated from the mean absolute residual at edges.
  static double MeanNoiseOf(const ResidualsAtEdges& at_edges) {
    return 1.2533 * at_edges.sizes / std::max(at_edges.weights, 1e-9);
  }
  // Returns the variance of a grey value at an edge if it exceeds what chance allows (2 sigma) when all grey values
  // have the same noise; otherwise 0.
  double SignificantVarianceOf(const ResidualsAtEdges& at_edges) const {
    const double num_effective = at_edges.weights * at_edges.weights / std::max(at_edges.weights_squared, 1e-9);
    const auto num_sought = static_cast<double>(NumSought());
    if (num_effective <= num_sought) return 0;
    const double variance = at_edges.squares / at_edges.weights * num_effective / (num_effective - num_sought);
    const double allowed = 1 + 2 * std::sqrt(2 / (num_effective - num_sought));
    return variance > allowed * 2 * result_.cost / Dof() ? variance : 0;
  }
  // Returns sigma as estimated from the median absolute residual.
  static double NoiseOf(std::vector<double> residuals) {
    for (double& residual : residuals) residual = std::abs(residual);
    return 1.4826 * Median(std::move(residuals));
  }

  Eigen::Vector2d centre_m_;
  Eigen::Vector2d half_m_;
  PatternRows rows_;
  PatternMap map_;
  Eigen::Matrix2d flat_normal_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d flat_right_ = Eigen::Vector2d::Zero();
  std::vector<int> sought_;
  bool is_stretch_free_ = false;
  PatternParams expected_ = PatternParams::Zero();  // Expected values of the terms that have an expectation.
  double squares_sigma_px_ = 0;
  PatternParams params_ = PatternParams::Zero();
  double noise_grey_ = 0;  // Sigma of a grey value; initially includes the misfit of the start.
  bool is_usable_ = false;
  Equations result_;
};

}  // namespace

std::optional<PatternFit> FitPattern(const cv::Mat& grey, const CellPattern& pattern,
                                     const Eigen::Matrix3d& start_image_from_pattern,
                                     const std::vector<Eigen::Vector2d>& wanted_m, const PatternFitOptions& options) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK((options.max_m.array() > options.min_m.array()).all());
  Fitter fitter(grey, pattern, start_image_from_pattern, options);
  if (!fitter.is_usable() || !fitter.Solve()) return std::nullopt;
  PatternFit fit;
  fit.blur_sigma_px = fitter.param(kBlur);
  fit.contrast_grey = fitter.contrast();
  fit.residual_ratio = fitter.noise_grey() / fit.contrast_grey;
  fit.outlier_share = fitter.OutlierShare();
  if (!(fit.contrast_grey >= options.min_contrast_grey && fit.residual_ratio <= options.max_residual_ratio)) {
    return std::nullopt;
  }
  const Eigen::MatrixXd covariance = fitter.Covariance();
  Eigen::MatrixXd by_params(2 * static_cast<Eigen::Index>(wanted_m.size()), covariance.cols());
  for (size_t k = 0; k < wanted_m.size(); ++k) {
    const Eigen::Vector2d unit = fitter.UnitOf(wanted_m[k]);
    fit.pixels.push_back(fitter.PixelAt(unit));
    if (!((fit.pixels.back() - ApplyHomography(start_image_from_pattern, wanted_m[k])).norm() <= options.max_move_px)) {
      return std::nullopt;
    }
    by_params.middleRows<2>(2 * static_cast<Eigen::Index>(k)) = fitter.PixelDerivative(unit);
  }
  fit.covariance_px2 = by_params * covariance * by_params.transpose();
  if (!fit.covariance_px2.allFinite()) return std::nullopt;
  return fit;
}

}  // namespace heba
