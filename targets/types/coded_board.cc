// A grid of dots, each in a ring of black and white sectors that encodes its id (ring_code.h, ring_decoder.h). Frame:
// origin at the first dot, x to the right along the columns, y down, z into the sheet. The dot (row, column) is at
// (column spacing, row spacing, 0) and has the id first_id + row * columns + column. The first sector of its code
// begins at the ring's rightmost point, and the code is read clockwise.
//
// A ring provides more than an id: together with the dot's outline and the perspective of its edges, it predicts the
// positions of the next dots. Readings that predict each other belong to one target (FindBoard).
#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/dots/dot_grid.h"
#include "targets/dots/ellipse_finder.h"
#include "targets/dots/ring_code.h"
#include "targets/dots/ring_decoder.h"
#include "targets/numbered_grid.h"
#include "targets/types/likely_misconfigurations.h"

namespace heba {
namespace {

struct CodedBoardOptions : DotGrid {
  double dot_diameter_m = 0;
  int bits = 12;
  int first_id = 0;
  RingCodeOrder code_order = RingCodeOrder::kSeparation;
};

// A dot that was read, as a point of the target.
struct FoundPoint {
  int point = 0;
  Eigen::Vector2d on_board = Eigen::Vector2d::Zero();  // Position on the target, in radii of a dot.
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  double radius_px = 0;
  double residual_ratio = 0;
  bool is_clear = false;
  // Homographies from the target's plane, in radii of a dot, to the image near the point, from its ring; several if
  // the ring has rotational symmetries.
  std::vector<Eigen::Matrix3d> pixel_from_plane;
};

class CodedBoard final : public Target {
 public:
  explicit CodedBoard(const CodedBoardOptions& options)
      : options_(options), codes_(BoardCodes(options)), decoder_(options.bits, options.polarity, codes_) {
    for (int row = 0; row < options_.rows; ++row) {
      for (int column = 0; column < options_.columns; ++column) {
        const size_t index = points_.size();
        point_of_code_[codes_[index]] = static_cast<int>(index);
        points_.push_back({options_.first_id + static_cast<int>(index),
                           {column * options_.spacing_m, row * options_.spacing_m, 0},
                           RadiusM()});
      }
    }
    drawing_ = MakeDrawing();
  }

  std::string_view type() const override { return "coded_board"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  std::vector<std::string> Codes() const override {
    std::vector<std::string> codes;
    for (const uint32_t code : codes_) {
      codes.push_back("ring of " + std::to_string(options_.bits) + " sectors " + std::to_string(code));
    }
    return codes;
  }

  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& grey) const override {
    std::vector<TargetSettings> confusions =
        OtherFirstIds("first_id", SeenIds(grey), options_.first_id, options_.rows * options_.columns);
    if (options_.rows != options_.columns) confusions.push_back(RowsAndColumns(options_.columns, options_.rows));
    confusions.push_back({{"code_order", options_.code_order == RingCodeOrder::kValue ? "separation" : "value"}});
    for (const int bits : {12, 14, 10, 8}) {
      if (bits != options_.bits) confusions.push_back({{"bits", std::to_string(bits)}});
    }
    confusions.push_back({{"light_on_dark", options_.polarity == DotPolarity::kDarkOnLight ? "true" : "false"}});
    const std::vector<TargetSettings> grids = ConfusedGrids(options_.rows, options_.columns);
    confusions.insert(confusions.end(), grids.begin(), grids.end());
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }
  TargetSettings UnitLengths() const override {
    return {{"spacing", UnitLength(1, 1)}, {"dot_diameter", UnitLength(options_.dot_diameter_m, options_.spacing_m)}};
  }

  Detection Detect(const cv::Mat& grey) const override {
    CHECK_EQ(grey.type(), CV_8UC1);
    const std::vector<FoundEllipse> dots = FindDots(grey);
    Detection detection;
    Board board = FindBoard(ReadDots(grey, dots));
    detection.reason = std::move(board.reason);
    for (const FoundPoint& point : board.points) {
      detection.ids.push_back(points_[static_cast<size_t>(point.point)].id);
      detection.pixels.push_back(point.pixel);
      detection.covariances_px2.emplace_back(point.covariance_px2);
    }
    if (detection.reason.empty() && board.points.size() < points_.size()) {
      detection.reason = std::to_string(board.points.size()) + " of the " + std::to_string(points_.size()) +
                         " points seen (" + std::to_string(dots.size()) + (dots.size() == 1 ? " dot" : " dots") +
                         " in the image)";
    }
    return detection;
  }

 private:
  // The largest number of points from which another one is predicted.
  static constexpr size_t kNumUsed = 8;

  std::vector<FoundEllipse> FindDots(const cv::Mat& grey) const {
    EllipseFinderOptions finder_options;
    finder_options.polarity = options_.polarity;
    finder_options.min_diameter_px = 3;
    return FindEllipses(grey, finder_options);
  }

  // Reads large dots first. Once half the target is known, reads the dots at the predicted positions of its points
  // and then those that look like a ring, so that a second copy of the target does not go unnoticed.
  std::vector<FoundPoint> ReadDots(const cv::Mat& grey, const std::vector<FoundEllipse>& dots) const {
    std::vector<std::pair<double, size_t>> unread;  // Radius in px and index.
    for (size_t i = 0; i < dots.size(); ++i) unread.emplace_back(dots[i].ellipse.RadiusPx(), i);
    std::sort(unread.begin(), unread.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    std::vector<FoundPoint> found;
    // Reads the wanted dots and removes them from `unread`. Returns whether there were any.
    const auto read = [&](const auto& is_wanted) {
      const auto rest = std::stable_partition(unread.begin(), unread.end(),
                                              [&](const auto& dot) { return is_wanted(dots[dot.second].ellipse); });
      for (auto dot = unread.begin(); dot != rest; ++dot) {
        const std::optional<RingReading> reading = decoder_.Read(grey, dots[dot->second].ellipse);
        if (reading) found = WithBetter(std::move(found), PointOf(*reading));
      }
      const bool has_read = rest != unread.begin();
      unread.erase(unread.begin(), rest);
      return has_read;
    };
    while (!unread.empty()) {
      const double least_px = 0.5 * unread.front().first;
      read([&](const Ellipse& dot) { return dot.RadiusPx() >= least_px; });
      const std::vector<FoundPoint> board = FindBoard(found).points;
      if (2 * board.size() < points_.size()) continue;
      std::vector<ExpectedDot> expected = ExpectedDots(board);
      while (!expected.empty() && read([&](const Ellipse& dot) {
        return std::any_of(expected.begin(), expected.end(), [&](const ExpectedDot& place) { return place.Fits(dot); });
      })) {
        expected = ExpectedDots(FindBoard(found).points);
      }
      if (expected.empty()) continue;
      read([&](const Ellipse& dot) { return decoder_.IsLikely(grey, dot); });
      break;
    }
    return found;
  }

  // The predicted position of a point of the target, and the approximate size of its dot.
  struct ExpectedDot {
    Eigen::Vector2d pixel;
    double reach_px;
    double radius_px;
    bool Fits(const Ellipse& dot) const {
      constexpr double kMaxRatio = 2.5;
      const double ratio = dot.RadiusPx() / radius_px;
      return (dot.centre_px - pixel).norm() < reach_px && ratio < kMaxRatio && ratio > 1 / kMaxRatio;
    }
  };

  // Predicts all points from those that are known. Returns an empty list if one cannot be predicted.
  std::vector<ExpectedDot> ExpectedDots(const std::vector<FoundPoint>& board) const {
    std::vector<ExpectedDot> expected;
    for (const TargetPoint& point : points_) {
      const Eigen::Vector2d on_board = point.in_target.head<2>() / RadiusM();
      const std::vector<size_t> nearest = Nearest(board, on_board, kNumUsed);
      const std::optional<Eigen::Vector2d> pixel = Expected(board, on_board, nearest);
      if (!pixel) return {};
      const FoundPoint& known = board[nearest.front()];
      const FoundPoint& next = board[nearest[1]];
      // The reach is half way to the next point, since lens distortion may displace points far from known ones.
      const double px_per_radius = (next.pixel - known.pixel).norm() / (next.on_board - known.on_board).norm();
      expected.push_back({*pixel, 0.5 * px_per_radius * options_.spacing_m / RadiusM(), known.radius_px});
    }
    return expected;
  }

  // Returns the ids of all codes of this kind whose rings are large and exact enough to be trusted.
  std::vector<int> SeenIds(const cv::Mat& grey) const {
    const std::vector<uint32_t> codes = RingCodes(options_.bits, options_.code_order);
    const RingDecoder decoder(options_.bits, options_.polarity, codes);
    std::vector<int> ids;
    for (const FoundEllipse& dot : FindDots(grey)) {
      const std::optional<RingReading> reading = decoder.Read(grey, dot.ellipse);
      if (!reading || !reading->is_clear) continue;
      ids.push_back(static_cast<int>(std::find(codes.begin(), codes.end(), reading->code) - codes.begin()));
    }
    return ids;
  }

  Drawing MakeDrawing() const {
    Drawing drawing;
    const double radius_m = RadiusM();
    const double margin_m = 4.5 * radius_m;
    drawing.min_m = Eigen::Vector2d::Constant(-margin_m);
    drawing.max_m = points_.back().in_target.head<2>().array() + margin_m;
    drawing.ground = options_.Ground();
    for (const TargetPoint& point : points_) {
      const Eigen::Vector2d centre_m = point.in_target.head<2>();
      // The shapes are the ring, its blank sectors as wedges that extend beyond it, the gap and the dot.
      drawing.AddDisc(centre_m, kRingOuter * radius_m, options_.Ink());
      std::vector<Shape> blank = BlankSectors(codes_[static_cast<size_t>(point.id - options_.first_id)], centre_m);
      std::move(blank.begin(), blank.end(), std::back_inserter(drawing.shapes));
      drawing.AddDisc(centre_m, kRingInner * radius_m, options_.Ground());
      drawing.AddDisc(centre_m, radius_m, options_.Ink());
      // The label is below the ring, to the right.
      const double height_m = 0.6 * radius_m;
      const double offset_m = 2.6 * radius_m;
      drawing.labels.push_back(
          {std::to_string(point.id), centre_m + Eigen::Vector2d(offset_m, offset_m + height_m), height_m});
    }
    return drawing;
  }

  // Returns whether rings that are not the target's hardly ever read as one of its codes. Only then is a point
  // accepted without confirmation by another one.
  bool IsRare() const {
    constexpr double kMaxChance = 0.02;
    return static_cast<double>(codes_.size()) * options_.bits <= kMaxChance * std::pow(2.0, options_.bits);
  }

  // Returns whether a point is accepted without confirmation by another one. A code with all its marks in one run may
  // be any arc or blot beside a dot.
  bool IsBelievedAlone(const FoundPoint& point) const {
    if (!point.is_clear || !IsRare()) return false;
    const uint32_t code = codes_[static_cast<size_t>(point.point)];
    return std::popcount(code ^ RotateRing(code, 1, options_.bits)) > 2;
  }

  static std::vector<uint32_t> BoardCodes(const CodedBoardOptions& options) {
    const std::vector<uint32_t> codes = RingCodes(options.bits, options.code_order);
    const auto first = codes.begin() + options.first_id;
    return {first, first + options.rows * options.columns};
  }

  double RadiusM() const { return 0.5 * options_.dot_diameter_m; }

  std::vector<Shape> BlankSectors(uint32_t code, const Eigen::Vector2d& centre_m) const {
    const int bits = options_.bits;
    const auto is_blank = [&](int sector) { return ((code >> (bits - 1 - sector % bits)) & 1U) == 0; };
    // A code is its own smallest rotation: it begins with a blank sector and ends with a marked one.
    CHECK(is_blank(0) && !is_blank(bits - 1));
    std::vector<Shape> wedges;
    for (int first = 0; first < bits; ++first) {
      if (!is_blank(first)) continue;
      int last = first;
      while (is_blank(last + 1)) ++last;
      Shape wedge;
      wedge.albedo = options_.Ground();
      wedge.points_m.push_back(centre_m);
      // Chords of at most half a sector, 22.5 degrees, at 3.2 radii stay outside 3.1 radii.
      const int num_steps = 2 * (last + 1 - first);
      for (int step = 0; step <= num_steps; ++step) {
        const double angle = 2 * kPi * (first + 0.5 * step) / bits;
        wedge.points_m.push_back(centre_m + 3.2 * RadiusM() * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      }
      wedges.push_back(std::move(wedge));
      first = last;
    }
    return wedges;
  }

  FoundPoint PointOf(const RingReading& reading) const {
    FoundPoint point;
    point.point = point_of_code_.at(reading.code);
    point.on_board = points_[static_cast<size_t>(point.point)].in_target.head<2>() / RadiusM();
    point.pixel = reading.dot.ellipse.centre_px;
    point.covariance_px2 = reading.dot.centre_covariance_px2;
    point.radius_px = reading.dot.ellipse.RadiusPx();
    point.residual_ratio = reading.residual_ratio;
    point.is_clear = reading.is_clear;
    for (int count = 0; count < options_.bits; ++count) {
      if (RotateRing(reading.code, count, options_.bits) != reading.code) continue;
      Eigen::Matrix3d ring_from_plane = Eigen::Matrix3d::Identity();
      const Eigen::Matrix2d turn = Eigen::Rotation2Dd(2 * kPi * count / options_.bits).toRotationMatrix();
      ring_from_plane.topLeftCorner<2, 2>() = turn;
      ring_from_plane.topRightCorner<2, 1>() = -turn * point.on_board;
      point.pixel_from_plane.push_back(reading.pixel_from_ring * ring_from_plane);
    }
    return point;
  }
  // Returns the points with one more. If a dot was a candidate twice, the better reading is kept.
  static std::vector<FoundPoint> WithBetter(std::vector<FoundPoint> found, FoundPoint point) {
    const auto same = std::find_if(found.begin(), found.end(), [&](const FoundPoint& other) {
      return !((other.pixel - point.pixel).norm() > 0.5 * std::min(other.radius_px, point.radius_px));
    });
    if (same == found.end()) {
      found.push_back(std::move(point));
    } else if (point.residual_ratio < same->residual_ratio) {
      *same = std::move(point);
    }
    return found;
  }

  // Returns whether one of the homographies of `a` predicts the position of `b`.
  static bool Predicts(const FoundPoint& a, const FoundPoint& b) {
    const double limit_px = 0.15 * (b.pixel - a.pixel).norm();
    return std::any_of(a.pixel_from_plane.begin(), a.pixel_from_plane.end(), [&](const Eigen::Matrix3d& map) {
      const Eigen::Vector3d mapped = map * b.on_board.homogeneous();
      return mapped.z() > 0.1 && (mapped.hnormalized() - b.pixel).norm() < limit_px;
    });
  }

  // Returns the indices by increasing distance on the target, at most `most`.
  static std::vector<size_t> ByDistance(std::vector<size_t> indices, const std::vector<FoundPoint>& found,
                                        const Eigen::Vector2d& on_board, size_t most) {
    std::sort(indices.begin(), indices.end(), [&](size_t a, size_t b) {
      const double distance_a = (found[a].on_board - on_board).squaredNorm();
      const double distance_b = (found[b].on_board - on_board).squaredNorm();
      return distance_a != distance_b ? distance_a < distance_b : a < b;
    });
    if (indices.size() > most) indices.resize(most);
    return indices;
  }
  // Returns the points nearest to a point, other than itself, at most `most`.
  static std::vector<size_t> Neighbours(const std::vector<FoundPoint>& found, size_t i, size_t most) {
    std::vector<size_t> others;
    for (size_t j = 0; j < found.size(); ++j) {
      if (j != i && found[j].point != found[i].point) others.push_back(j);
    }
    return ByDistance(std::move(others), found, found[i].on_board, most);
  }
  static std::vector<size_t> Nearest(const std::vector<FoundPoint>& found, const Eigen::Vector2d& on_board,
                                     size_t most) {
    std::vector<size_t> all(found.size());
    std::iota(all.begin(), all.end(), 0);
    return ByDistance(std::move(all), found, on_board, most);
  }

  struct Board {
    std::vector<FoundPoint> points;
    std::string reason;
  };
  // Returns the points that agree on the pose of the target, by increasing id. Returns none if no points agree, or,
  // with a reason, if the two largest groups that agree have the same size.
  Board FindBoard(const std::vector<FoundPoint>& found) const {
    constexpr size_t kMaxNeighbours = 12;
    std::vector<size_t> group(found.size());
    std::iota(group.begin(), group.end(), 0);
    const auto group_of = [&](size_t i) {
      while (group[i] != i) i = group[i];
      return i;
    };
    for (size_t i = 0; i < found.size(); ++i) {
      for (const size_t j : Neighbours(found, i, kMaxNeighbours)) {
        if (Predicts(found[i], found[j]) && Predicts(found[j], found[i])) group[group_of(i)] = group_of(j);
      }
    }
    std::map<size_t, std::vector<size_t>> groups;
    for (size_t i = 0; i < found.size(); ++i) groups[group_of(i)].push_back(i);
    std::vector<std::vector<size_t>> sorted;
    for (auto& [root, members] : groups) {
      if (members.size() > 1 || IsBelievedAlone(found[members[0]])) sorted.push_back(std::move(members));
    }
    std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
    if (sorted.empty()) return {};
    if (sorted.size() > 1 && sorted[1].size() == sorted[0].size()) {
      return {{}, "the points seen do not match the target, or two copies of it are in view"};
    }
    std::vector<FoundPoint> board;
    for (const size_t i : sorted[0]) board.push_back(found[i]);
    // The target's order makes the result independent of the order in which points were read.
    std::stable_sort(board.begin(), board.end(),
                     [](const FoundPoint& a, const FoundPoint& b) { return a.point < b.point; });
    board = WithoutOutliers(std::move(board));
    // Points with the same id are all removed.
    Board unique;
    for (size_t i = 0; i < board.size(); ++i) {
      const bool twice = (i > 0 && board[i - 1].point == board[i].point) ||
                         (i + 1 < board.size() && board[i + 1].point == board[i].point);
      if (!twice) unique.points.push_back(board[i]);
    }
    return unique;
  }

  // Returns the points without those, worst first, that are not where their neighbours predict them. Lens distortion
  // bends a target, but hardly among neighbours.
  static std::vector<FoundPoint> WithoutOutliers(std::vector<FoundPoint> board) {
    while (board.size() >= 6) {
      size_t worst = 0;
      double worst_ratio = 1;
      for (size_t i = 0; i < board.size(); ++i) {
        const std::vector<size_t> others = Neighbours(board, i, kNumUsed);
        const std::optional<Eigen::Vector2d> expected = Expected(board, board[i].on_board, others);
        if (!expected) continue;
        const double step_px = (board[others[0]].pixel - board[i].pixel).norm();
        const double ratio = (*expected - board[i].pixel).norm() / (0.08 * step_px + 1);
        if (ratio > worst_ratio) {
          worst_ratio = ratio;
          worst = i;
        }
      }
      if (worst_ratio <= 1) break;
      board.erase(board.begin() + static_cast<std::ptrdiff_t>(worst));
    }
    return board;
  }

  // Predicts the pixel of a point from the homography through `others` (linear least squares, centred and scaled).
  // Returns nothing if they do not determine it.
  static std::optional<Eigen::Vector2d> Expected(const std::vector<FoundPoint>& board,
                                                 const Eigen::Vector2d& plane_origin,
                                                 const std::vector<size_t>& others) {
    if (others.size() < 5) return std::nullopt;
    const Eigen::Vector2d pixel_origin = board[others[0]].pixel;
    const double plane_unit = (board[others.back()].on_board - plane_origin).norm();
    const double pixel_unit = (board[others.back()].pixel - pixel_origin).norm() + 1;
    Eigen::Matrix<double, Eigen::Dynamic, 8> rows(2 * static_cast<Eigen::Index>(others.size()), 8);
    Eigen::VectorXd values(rows.rows());
    for (size_t n = 0; n < others.size(); ++n) {
      const Eigen::RowVector2d plane = (board[others[n]].on_board - plane_origin).transpose() / plane_unit;
      const Eigen::Vector2d pixel = (board[others[n]].pixel - pixel_origin) / pixel_unit;
      const Eigen::Index row = 2 * static_cast<Eigen::Index>(n);
      rows.row(row) << plane, 1, 0, 0, 0, -pixel.x() * plane;
      rows.row(row + 1) << 0, 0, 0, plane, 1, -pixel.y() * plane;
      values.segment<2>(row) = pixel;
    }
    const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, Eigen::Dynamic, 8>> solver(rows);
    // The homography is undetermined if all points but one lie on a line.
    if (solver.rank() < 8 || std::abs(solver.matrixR()(7, 7)) < 1e-3 * std::abs(solver.matrixR()(0, 0))) {
      return std::nullopt;
    }
    const Eigen::Matrix<double, 8, 1> map = solver.solve(values);
    return pixel_origin + pixel_unit * Eigen::Vector2d(map[2], map[5]);
  }

  CodedBoardOptions options_;
  std::vector<uint32_t> codes_;  // Codes of the points.
  RingDecoder decoder_;
  std::vector<TargetPoint> points_;
  std::map<uint32_t, int> point_of_code_;
  Drawing drawing_;
};

}  // namespace

std::unique_ptr<Target> CreateTarget_coded_board(MapReader& reader) {
  CodedBoardOptions options{ReadDotGrid(reader)};
  options.dot_diameter_m = reader.PositiveLength("dot_diameter", 0.25 * options.spacing_m);
  // The least spacing leaves the ring of each dot outside the quiet zone of the next one.
  const double least_spacing_m = 0.5 * (kRingOuter + kRingQuiet) * options.dot_diameter_m;
  if (options.spacing_m < least_spacing_m * (1 - 1e-9)) {
    const std::optional<ConfigValue> given = reader.Find("dot_diameter");
    (given ? *given : reader.Get("spacing"))
        .Fail("the rings, of three times the dot's diameter, are too close to each other: use at most spacing / 3.25");
  }
  options.bits = reader.Int("bits", {8, 14}, 12);
  if (!IsRingSize(options.bits)) reader.Get("bits").Fail("must be 8, 10, 12 or 14");
  const std::string order = reader.Choice("code_order", {"separation", "value"}, "separation");
  options.code_order = order == "value" ? RingCodeOrder::kValue : RingCodeOrder::kSeparation;
  const int num_points = options.rows * options.columns;
  const int num_codes = static_cast<int>(RingCodes(options.bits, options.code_order).size());
  options.first_id = reader.Int("first_id", {0, 1000000}, 0);
  if (options.first_id + num_points > num_codes) {
    const std::optional<ConfigValue> given = reader.Find("bits");
    (given ? *given : reader.Get("rows"))
        .Fail(std::to_string(num_points) + " points from id " + std::to_string(options.first_id) +
              " on need more than the " + std::to_string(num_codes) + " codes of " + std::to_string(options.bits) +
              " bits" + (options.bits < 14 ? "; use more bits" : ""));
  }
  return std::make_unique<CodedBoard>(options);
}

// The largest dot, as a share of the spacing, whose ring leaves the next one quiet.
constexpr double kLargestShare = 0.3;

namespace {

struct SeenRing {
  uint32_t code = 0;
  Ellipse dot;
};

// The dots of an image, each of which is fitted at most once.
class Dots {
 public:
  Dots(const cv::Mat& grey, const std::vector<FoundEllipse>& found)
      : grey_(grey), found_(found), fitted_(found.size()) {}

  // Dots from all parts of the image are read in turn; the search ends if none of the first has a ring.
  std::vector<SeenRing> RingsOf(const RingDecoder& decoder) {
    std::vector<SeenRing> rings;
    constexpr size_t kFirst = 40;
    const size_t stride = std::max<size_t>(1, (found_.size() + kFirst - 1) / kFirst);
    size_t num_fitted = 0;
    for (size_t start = 0; start < stride; ++start) {
      for (size_t i = start; i < found_.size(); i += stride) {
        if (rings.empty() && num_fitted >= kFirst) return rings;
        const Ellipse& dot = found_[i].ellipse;
        // Most dots of other targets are told from rings without a fit.
        const bool is_large = dot.SemiAxesPx().y() >= RingDecoder::kLeastLikelyRadiusPx;
        if (is_large ? !decoder.IsLikely(grey_, dot) : !decoder.MayRead(grey_, dot)) continue;
        ++num_fitted;
        if (!fitted_[i]) fitted_[i] = decoder.FitDot(grey_, dot);
        if (!*fitted_[i]) continue;
        const std::optional<RingReading> reading = decoder.ReadAround(grey_, **fitted_[i]);
        if (reading && reading->is_clear) rings.push_back({reading->code, dot});
      }
    }
    return rings;
  }

 private:
  const cv::Mat& grey_;
  const std::vector<FoundEllipse>& found_;
  std::vector<std::optional<std::optional<RefinedEllipse>>> fitted_;
};

// Returns the board whose points have these codes, in this order; nothing if the rings are not on a grid.
std::optional<TargetSettings> BoardOf(const std::vector<SeenRing>& rings, const std::vector<uint32_t>& codes) {
  std::vector<SeenNumber> seen;
  std::vector<double> diameters_px;
  int last = 0;
  for (const SeenRing& ring : rings) {
    const auto found = std::find(codes.begin(), codes.end(), ring.code);
    if (found == codes.end()) continue;
    const auto number = static_cast<int>(found - codes.begin());
    seen.push_back({number, ring.dot.centre_px});
    diameters_px.push_back(2 * ring.dot.RadiusPx());
    last = std::max(last, number);
  }
  constexpr int kMostColumns = 40;
  const std::optional<NumberedGrid> grid = FindNumberedGrid(
      seen, kMostColumns, [](int index, int columns) { return Eigen::Vector2d(index % columns, index / columns); });
  if (!grid) return std::nullopt;
  TargetSettings board = RowsAndColumns((last - grid->first) / grid->columns + 1, grid->columns);
  board.emplace_back("spacing", UnitLength(1, 1));
  std::vector<double> diameters;  // The dots' diameters, as shares of the spacing.
  for (size_t i = 0; i < seen.size(); ++i) {
    diameters.push_back(diameters_px[i] / CellSizePx(grid->pixel_from_cell, seen[i].pixel));
  }
  board.emplace_back("dot_diameter", Fixed(std::min(Median(diameters), kLargestShare), 2) + " m");
  if (grid->first > 0) board.emplace_back("first_id", std::to_string(grid->first));
  return board;
}

}  // namespace

std::vector<TargetSettings> ProposeTargets_coded_board(const cv::Mat& grey) {
  struct Codes {
    int bits;
    RingCodeOrder order;
    std::vector<uint32_t> codes;
  };
  std::vector<Codes> all;
  constexpr int kBits[] = {8, 10, 12, 14};
  for (const int bits : kBits) {
    for (const RingCodeOrder order : {RingCodeOrder::kSeparation, RingCodeOrder::kValue}) {
      all.push_back({bits, order, RingCodes(bits, order)});
    }
  }
  for (const DotPolarity polarity : {DotPolarity::kDarkOnLight, DotPolarity::kLightOnDark}) {
    EllipseFinderOptions finder_options;
    finder_options.polarity = polarity;
    finder_options.min_diameter_px = 3;
    const std::vector<FoundEllipse> found = FindEllipses(grey, finder_options);
    Dots dots(grey, found);
    for (const int bits : kBits) {
      // The codes of both orders are read at once.
      std::vector<uint32_t> codes;
      for (const Codes& list : all) {
        if (list.bits == bits) codes.insert(codes.end(), list.codes.begin(), list.codes.end());
      }
      const std::vector<SeenRing> rings = dots.RingsOf(RingDecoder(bits, polarity, codes));
      for (const Codes& list : all) {
        if (list.bits != bits) continue;
        std::optional<TargetSettings> board = BoardOf(rings, list.codes);
        if (!board) continue;
        board->emplace_back("bits", std::to_string(bits));
        if (list.order == RingCodeOrder::kValue) board->emplace_back("code_order", "value");
        if (polarity == DotPolarity::kLightOnDark) board->emplace_back("light_on_dark", "true");
        return {std::move(*board)};
      }
    }
  }
  return {};
}

}  // namespace heba
