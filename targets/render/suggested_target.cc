#include "heba/suggested_target.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/render/sheet.h"

namespace heba {
namespace {

// How the YAML of a type follows from the size of its feature and from its rows and columns.
struct Proposal {
  std::string_view name;
  // The size, px, from which on 98 % of the points are found in rendered images: tilts up to 35 deg, a blur of 0.8 px,
  // noise of 2 grey, 30 % of uneven light.
  double least_px;
  int max_features;  // More points add little.
  int min_rows;
  std::string (*yaml)(double feature_mm, int rows, int columns);
};

std::string Counts(std::string_view type, int rows, int columns) {
  return "type: " + std::string(type) + "\nrows: " + std::to_string(rows) + "\ncolumns: " + std::to_string(columns) +
         "\n";
}
std::string Millimetres(double length_mm) { return RoundTrip(length_mm) + " mm\n"; }

constexpr double kMarkerShare = 0.75;  // The marker of a charuco square.

const Proposal kProposals[] = {
    {"coded_board", 28, 80, 3,
     [](double mm, int rows, int columns) {
       return Counts("coded_board", rows, columns) + "spacing: " + Millimetres(mm);
     }},
    {"apriltag_grid", 40, 36, 2,
     [](double mm, int rows, int columns) {
       return Counts("apriltag_grid", rows, columns) + "family: tag36h11\ntag_size: " + Millimetres(mm) +
              "tag_spacing: 0.3\n";
     }},
    // The sum of rows and columns is odd, or the board would look the same from the other side.
    {"chessboard", 12, 120, 4,
     [](double mm, int rows, int columns) {
       return Counts("chessboard", rows, (rows + columns) % 2 == 0 ? columns - 1 : columns) +
              "square: " + Millimetres(mm);
     }},
    {"charuco", 28, 120, 4,
     [](double mm, int rows, int columns) {
       return Counts("charuco", rows, columns) + "square: " + Millimetres(mm) +
              "marker: " + Millimetres(kMarkerShare * mm) + "dictionary: DICT_5X5_100\n";
     }},
    {"circle_grid", 14, 120, 4, [](double mm, int rows, int columns) {
       return Counts("circle_grid", rows, columns) + "spacing: " + Millimetres(mm) + "marker_dot: true\n";
     }}};

constexpr double kRoundSizesMm[] = {4,  5,  6,  8,  10, 12, 15,  20,  25,  30,  35,  40,
                                    45, 50, 60, 70, 80, 90, 100, 120, 150, 200, 250, 300};
constexpr double kReserve = 1.25;         // For views from farther away.
constexpr double kMostShare = 2.0 / 3.0;  // Of the image's width and height.

Sheet SheetOf(const std::string& yaml, const Eigen::Vector2d& paper_mm) {
  MapReader reader(ParseYaml(yaml, "suggested target"));
  const std::unique_ptr<Target> target = CreateTarget(reader);
  SheetOptions options;
  options.paper_mm = paper_mm;
  options.config = FlowText(reader.used());
  return MakeSheet(*target, options);
}

Eigen::Vector2d DrawnMm(const Sheet& sheet) { return 1000 * (sheet.drawing.max_m - sheet.drawing.min_m); }

struct Grid {
  int rows = 0;
  int columns = 0;
};

// Returns the largest grid that fits on the paper in one format and into the image.
Grid LargestGrid(const Proposal& proposal, double feature_mm, const Eigen::Vector2d& page_mm,
                 const Eigen::Vector2d& room_in_image_mm, const Eigen::Vector2d& paper_mm) {
  // The size of the drawing is linear in the numbers of columns and rows.
  const int n = 4;
  const Sheet small = SheetOf(proposal.yaml(feature_mm, n, n + 1), paper_mm);
  const Sheet large = SheetOf(proposal.yaml(feature_mm, n + 1, n + 2), paper_mm);
  const Eigen::Array2d pitch_mm = DrawnMm(large) - DrawnMm(small);
  const Eigen::Array2d rest_mm = small.content_mm - DrawnMm(small).cwiseMax(Eigen::Vector2d(small.ruler_mm, 0));
  const Eigen::Array2d room_mm = (page_mm.array() - rest_mm).min(room_in_image_mm.array());
  const Eigen::Array2d more = ((room_mm - DrawnMm(small).array()) / pitch_mm + 1e-9).floor();
  return {n + static_cast<int>(more.y()), n + 1 + static_cast<int>(more.x())};
}

}  // namespace

SuggestedTarget SuggestTarget(std::string_view type, const TargetPurpose& purpose) {
  const Proposal* const proposal = FindEntry(kProposals, type);
  CHECK(proposal != nullptr) << type;
  const double px_per_mm = std::min(purpose.camera.params[0], purpose.camera.params[1]) / (1000 * purpose.distance_m);
  const Eigen::Vector2d image_mm = Eigen::Vector2d(purpose.camera.width_px, purpose.camera.height_px) / px_per_mm;
  std::string best;
  double best_mm = 0;
  for (const double feature_mm : kRoundSizesMm) {
    Grid grid;
    for (const Eigen::Vector2d& page_mm : {purpose.paper_mm, Eigen::Vector2d(purpose.paper_mm.reverse())}) {
      const Grid fits = LargestGrid(*proposal, feature_mm, page_mm, kMostShare * image_mm, purpose.paper_mm);
      if (fits.rows >= proposal->min_rows && fits.columns > proposal->min_rows &&
          fits.rows * fits.columns > grid.rows * grid.columns) {
        grid = fits;
      }
    }
    if (grid.rows == 0) break;  // Larger features do not fit.
    best = proposal->yaml(feature_mm, grid.rows, grid.columns);
    best_mm = feature_mm;
    const bool is_large_enough = feature_mm * px_per_mm >= kReserve * proposal->least_px;
    if (is_large_enough && grid.rows * grid.columns <= proposal->max_features) break;
    // Fewer features than fit, rather than more than are useful.
    if (grid.rows * grid.columns > proposal->max_features) best.clear();
  }
  if (best.empty()) return {};
  const Sheet sheet = SheetOf(best, purpose.paper_mm);
  return {best, DrawnMm(sheet), best_mm * px_per_mm, proposal->least_px, DrawnMm(sheet).y() / image_mm.y()};
}

}  // namespace heba
