#include "targets/render/suggestion.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/detection.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "targets/render/sheet.h"
#include "targets/render/target_text.h"

namespace heba {
namespace {

std::string Mm(double mm) { return RoundTrip(mm) + " mm"; }

std::string Grid(const char* type, int columns, int rows) {
  return "type: " + std::string(type) + "\nrows: " + std::to_string(rows) + "\ncolumns: " + std::to_string(columns) +
         "\n";
}

// A target as proposed.
struct Design {
  std::string config;     // Its YAML.
  double feature_mm = 0;  // The size of the smallest part that must be resolved (Proposal::feature).
};

// The target whose main length is `unit_mm`.
Design CodedBoard(int unit_mm, int columns, int rows) {
  const double dot_mm = 0.3 * unit_mm;
  return {Grid("coded_board", columns, rows) + "spacing: " + Mm(unit_mm) + "\ndot_diameter: " + Mm(dot_mm) + "\n",
          dot_mm};
}

Design AprilTagGrid(int unit_mm, int columns, int rows) {
  constexpr double kCells = 8;  // Across a tag of this family, with its border.
  return {Grid("apriltag_grid", columns, rows) + "family: tag36h11\ntag_size: " + Mm(unit_mm) + "\ntag_spacing: 0.3\n",
          unit_mm / kCells};
}

Design Chessboard(int unit_mm, int columns, int rows) {
  return {Grid("chessboard", columns, rows) + "square: " + Mm(unit_mm) + "\n", static_cast<double>(unit_mm)};
}

Design Charuco(int unit_mm, int columns, int rows) {
  const int num_markers = rows * columns / 2;
  const char* const dictionary = num_markers <= 50    ? "DICT_4X4_50"
                                 : num_markers <= 100 ? "DICT_4X4_100"
                                                      : "DICT_4X4_250";
  const double marker_mm = std::floor(0.75 * unit_mm);
  constexpr double kCells = 6;  // Across a marker of these dictionaries, with its border.
  return {Grid("charuco", columns, rows) + "square: " + Mm(unit_mm) + "\nmarker: " + Mm(marker_mm) +
              "\ndictionary: " + dictionary + "\n",
          marker_mm / kCells};
}

Design CircleGrid(int unit_mm, int columns, int rows) {
  const double dot_mm = 0.5 * unit_mm;
  return {Grid("circle_grid", columns, rows) + "spacing: " + Mm(unit_mm) + "\ndot_diameter: " + Mm(dot_mm) +
              "\nmarker_dot: true\n",
          dot_mm};
}

// How targets of a type are proposed.
struct Proposal {
  std::string_view name;
  std::string_view feature;
  // The least size of the feature from which on all points are found in nearly every image with a tilt of up to 35 deg,
  // a blur of 0.7 px and a noise of 2 grey (docs/manual/targets.md has the measurements).
  double least_px;
  int least_columns;
  int least_rows;
  Design (*design)(int unit_mm, int columns, int rows);
};
constexpr Proposal kProposals[] = {
    {"coded_board", "a dot", 6, 3, 3, CodedBoard},   {"apriltag_grid", "a cell of a tag", 4.5, 2, 2, AprilTagGrid},
    {"chessboard", "a square", 4, 4, 3, Chessboard}, {"charuco", "a cell of a marker", 3, 4, 3, Charuco},
    {"circle_grid", "a dot", 7, 4, 3, CircleGrid},
};

// Captures may be farther away than the distance by this factor.
constexpr double kReserve = 1.25;
constexpr double kMaxHeightShare = 0.5;
constexpr double kMaxWidthShare = 0.6;
constexpr double kLeastFound = 0.95;
constexpr int kUnitStepMm = 5;
constexpr int kLargestUnitMm = 500;
constexpr int kMaxSide = 40;  // The most rows, and the most columns.
// The most patterns of one main length that are rendered: a pattern that reaches beyond the image, for example with a
// principal point off its middle, may have a neighbour that does not. More would take too long.
constexpr size_t kMaxTried = 3;

Eigen::Vector2d DrawingMm(const Target& target) { return 1000 * (target.Draw().max_m - target.Draw().min_m); }

// Returns the sheet of a target on the paper.
Sheet SheetOf(const std::string& config, const Paper& paper) {
  MapReader reader(ParseYaml(config, "suggestion"));
  const std::unique_ptr<Target> target = CreateTarget(reader);
  SheetOptions options;
  options.title = TargetTitle(*target, reader.used());
  options.config = TargetConfigLine(reader.used());
  options.paper = paper;
  return MakeSheet(*target, options);
}

Eigen::Vector3d MiddleOf(const Drawing& drawing) {
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  return {middle_m.x(), middle_m.y(), 0};
}

// The target's middle on the optical axis, tilted about a diagonal of the image.
Rigid3d TrialPose(const Drawing& drawing, double distance_m) {
  const Eigen::Quaterniond front =
      drawing.y_up ? ExpRotation(kPi * Eigen::Vector3d::UnitX()) : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond rotation =
      ExpRotation(DegToRad(kTrialTiltDeg) * Eigen::Vector3d(1, 1, 0).normalized()) * front;
  return {rotation, Eigen::Vector3d(0, 0, distance_m) - rotation * MiddleOf(drawing)};
}

double LargestSigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, EigenOfSymmetric(covariance).values[2]));
}

// Propagates the stated covariances of the pixels to the pose of the target's middle.
PoseSigma SigmaOf(const Target& target, const Camera& camera, const Rigid3d& camera_from_target,
                  const Detection& detection) {
  const Rigid3d target_from_middle(Eigen::Quaterniond::Identity(), MiddleOf(target.Draw()));
  const auto pixel_of = [&](const TargetPoint& point, int parameter, double step) {
    Eigen::Matrix<double, 6, 1> xi = Eigen::Matrix<double, 6, 1>::Zero();
    xi[parameter] = step;
    const Rigid3d middle_from_middle(ExpRotation(xi.tail<3>()), xi.head<3>());
    return PixelOf(point, camera,
                   camera_from_target * target_from_middle * middle_from_middle * Inverse(target_from_middle))
        .value_or(Eigen::Vector2d::Zero());
  };
  constexpr double kStep = 1e-6;  // m or rad
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  size_t next = 0;
  for (const Eigen::MatrixXd& covariance_px2 : detection.covariances_px2) {
    Eigen::MatrixXd jacobian(covariance_px2.rows(), 6);
    for (Eigen::Index row = 0; row < jacobian.rows(); row += 2, ++next) {
      const auto point =
          std::find_if(target.points().begin(), target.points().end(),
                       [&](const TargetPoint& candidate) { return candidate.id == detection.ids[next]; });
      for (int k = 0; k < 6; ++k) {
        jacobian.block<2, 1>(row, k) = (pixel_of(*point, k, kStep) - pixel_of(*point, k, -kStep)) / (2 * kStep);
      }
    }
    information += jacobian.transpose() * SolveSymmetric(covariance_px2, jacobian);
  }
  const Eigen::Matrix<double, 6, 6> covariance = InverseOfSymmetric(information);
  return {LargestSigma(covariance.topLeftCorner<3, 3>()), LargestSigma(covariance.bottomRightCorner<3, 3>())};
}

// Finds a target's columns and rows for one main length.
class PatternFitter {
 public:
  PatternFitter(const Proposal& proposal, const SuggestionOptions& options) : proposal_(proposal), options_(options) {
    for (const int axis : {0, 1}) px_per_m_[axis] = AxialFocalLength(options.camera, axis) / options.distance_m;
  }

  double FeaturePx(int unit_mm) const { return 1e-3 * LeastDesign(unit_mm).feature_mm * px_per_m_.minCoeff(); }

  // Returns the patterns with the most information that fit, at most kMaxTried.
  std::vector<Suggestion> Fit(int unit_mm) const {
    const int columns = proposal_.least_columns;
    const int rows = proposal_.least_rows;
    const Eigen::Vector2d least_mm = LeastMm(unit_mm);
    const Eigen::Vector2d pitch_mm =
        DrawingMm(*ParseTarget(proposal_.design(unit_mm, columns + 1, rows + 1).config)) - least_mm;
    const Eigen::Vector2d most_mm = MostInImageMm();
    struct Pattern {
      int columns;
      int rows;
      double information;
    };
    std::vector<Pattern> patterns;
    for (int c = columns; c <= kMaxSide; ++c) {
      for (int r = rows; r <= kMaxSide; ++r) {
        const Eigen::Vector2d size_mm = least_mm + Eigen::Vector2d(c - columns, r - rows).cwiseProduct(pitch_mm);
        if ((size_mm.array() > most_mm.array() + 1e-6).any()) continue;
        if (!FitsPaper(size_mm)) continue;
        patterns.push_back({c, r, Information(size_mm, c * r, unit_mm)});
      }
    }
    std::stable_sort(patterns.begin(), patterns.end(),
                     [](const Pattern& a, const Pattern& b) { return a.information > b.information; });
    std::vector<Suggestion> suggestions;
    for (const Pattern& pattern : patterns) {
      std::optional<Suggestion> suggestion = Try(unit_mm, pattern.columns, pattern.rows);
      if (suggestion) suggestions.push_back(std::move(*suggestion));
      if (suggestions.size() == kMaxTried) break;
    }
    return suggestions;
  }

  // Returns whether the smallest pattern fits into the image and, roughly, on the paper.
  bool FitsLeast(int unit_mm) const {
    const Eigen::Vector2d least_mm = LeastMm(unit_mm);
    return (least_mm.array() <= MostInImageMm().array()).all() && FitsPaper(least_mm);
  }

  // Returns the suggestion with what a detection of the rendered target gives; nothing if the target is not found.
  std::optional<Suggestion> Measured(Suggestion suggestion) const {
    const std::unique_ptr<Target> target = ParseTarget(suggestion.config);
    const Rigid3d camera_from_target = TrialPose(target->Draw(), options_.distance_m);
    RenderOptions render;
    render.blur_sigma_px = kTrialBlurPx;
    render.noise_sigma_grey = kTrialNoiseGrey;
    const Detection detection = target->Detect(RenderView(target->Draw(), options_.camera, camera_from_target, render));
    suggestion.num_found = detection.ids.size();
    if (static_cast<double>(suggestion.num_found) < kLeastFound * static_cast<double>(suggestion.num_points)) {
      return std::nullopt;
    }
    suggestion.sigma = SigmaOf(*target, options_.camera, camera_from_target, detection);
    return suggestion;
  }

 private:
  Eigen::Vector2d ImagePx() const { return {options_.camera.width_px, options_.camera.height_px}; }

  Design LeastDesign(int unit_mm) const {
    return proposal_.design(unit_mm, proposal_.least_columns, proposal_.least_rows);
  }

  // Returns the size of the smallest pattern.
  Eigen::Vector2d LeastMm(int unit_mm) const { return DrawingMm(*ParseTarget(LeastDesign(unit_mm).config)); }

  // Returns the largest size that a drawing may have in the image.
  Eigen::Vector2d MostInImageMm() const {
    const Eigen::Vector2d image_mm = 1000 * ImagePx().cwiseQuotient(px_per_m_);
    return image_mm.cwiseProduct(Eigen::Vector2d(kMaxWidthShare, kMaxHeightShare));
  }

  // Returns whether the drawing alone fits on the paper, on either side.
  bool FitsPaper(const Eigen::Vector2d& size_mm) const {
    const Eigen::Vector2d paper_mm = options_.paper.SizeMm(false);
    return size_mm.maxCoeff() < paper_mm.maxCoeff() && size_mm.minCoeff() < paper_mm.minCoeff();
  }

  // The information on the target's pose: it grows with the number of points, the square of their distances, and the
  // lengths of their edges.
  static double Information(const Eigen::Vector2d& size_mm, int num_points, int unit_mm) {
    return size_mm.prod() * num_points * unit_mm;
  }

  // Returns the target if it has not too many points, no symmetry, and one page.
  std::optional<Suggestion> Try(int unit_mm, int columns, int rows) const {
    Suggestion suggestion;
    const Design design = proposal_.design(unit_mm, columns, rows);
    suggestion.config = design.config;
    std::unique_ptr<Target> target;
    try {
      target = ParseTarget(suggestion.config);
    } catch (const InputError&) {
      return std::nullopt;  // The type has no such pattern, for example not enough codes.
    }
    suggestion.num_points = target->points().size();
    if (suggestion.num_points > kMaxSuggestedPoints || target->Symmetries().size() > 1) return std::nullopt;
    const Sheet sheet = SheetOf(suggestion.config, options_.paper);
    if (sheet.pages.size() > 1) return std::nullopt;
    suggestion.drawing_mm = DrawingMm(*target);
    suggestion.page_mm = sheet.page_mm;
    suggestion.feature = proposal_.feature;
    suggestion.feature_px = 1e-3 * design.feature_mm * px_per_m_.minCoeff();
    suggestion.information = Information(suggestion.drawing_mm, columns * rows, unit_mm);
    const Eigen::Vector2d share = (1e-3 * suggestion.drawing_mm).cwiseProduct(px_per_m_).cwiseQuotient(ImagePx());
    suggestion.width_share = share.x();
    suggestion.height_share = share.y();
    return suggestion;
  }

  const Proposal& proposal_;
  const SuggestionOptions& options_;
  Eigen::Vector2d px_per_m_;
};

}  // namespace

std::vector<std::string> SuggestedTypes() { return NamesOf(kProposals); }

std::string SuggestionOptions::Check() const {
  std::vector<std::string> faults;
  if (FindEntry(kProposals, type) == nullptr) {
    faults.push_back("the type must be one of " + Join(SuggestedTypes(), ", ") + ", not " + Quoted(type) +
                     DidYouMean(type, SuggestedTypes()));
  }
  if (!(distance_m >= 0.01 && distance_m <= 100)) faults.push_back("the distance must be from 10 mm to 100 m");
  if (const std::string fault = CheckCamera(camera); !fault.empty()) faults.push_back(fault);
  return Join(faults, "\n");
}

Outcome<Suggestion> SuggestTarget(const SuggestionOptions& options) {
  CHECK(options.Check().empty()) << options.Check();
  const Proposal& proposal = *FindEntry(kProposals, options.type);
  const PatternFitter fitter(proposal, options);
  const double least_px = kReserve * proposal.least_px;
  std::vector<Suggestion> suggestions;
  int least_unit_mm = 0;
  for (int unit_mm = kUnitStepMm; unit_mm <= kLargestUnitMm; unit_mm += kUnitStepMm) {
    if (fitter.FeaturePx(unit_mm) < least_px) continue;
    if (least_unit_mm == 0) least_unit_mm = unit_mm;
    std::vector<Suggestion> best = fitter.Fit(unit_mm);
    // Larger ones do not fit either, unless these have too many points.
    if (best.empty() && !fitter.FitsLeast(unit_mm)) break;
    std::move(best.begin(), best.end(), std::back_inserter(suggestions));
  }
  std::stable_sort(suggestions.begin(), suggestions.end(),
                   [](const Suggestion& a, const Suggestion& b) { return a.information > b.information; });
  for (const Suggestion& suggestion : suggestions) {
    if (std::optional<Suggestion> measured = fitter.Measured(suggestion)) return std::move(*measured);
  }
  const std::string size = std::string(proposal.feature) + " needs " + Significant(least_px, 2) + " px";
  const std::string reason =
      !suggestions.empty() ? "it is not found in a rendered image"
      : least_unit_mm == 0
          ? size + ", more than any has"
          : size + ", and the least pattern of such a size does not fit on the paper or takes more than " +
                "half of the image's height";
  return Failure{"no " + options.type + " on " + std::string(options.paper.name) + " suits this camera at " +
                 Significant(options.distance_m, 3) + " m: " + reason};
}

}  // namespace heba
