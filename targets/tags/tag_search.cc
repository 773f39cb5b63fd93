#include "targets/tags/tag_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "heba/base/median.h"
#include "heba/base/registry.h"
#include "heba/geometry/homography.h"
#include "targets/corners/corner_refinement.h"
#include "targets/corners/pattern_fit.h"
#include "targets/images/image.h"

namespace heba {
namespace {

// No tag can be decoded in a smaller image, and libapriltag's tiles do not fit into it.
constexpr int kMinImageSidePx = 16;
bool IsTooSmall(const cv::Mat& grey) { return std::min(grey.cols, grey.rows) < kMinImageSidePx; }

// The number of pixels with which an image shows most of what there is.
constexpr double kSeenWellPx = 1e6;
// Returns the factor by which the image must be reduced to this many pixels.
double DecimationTo(const cv::Mat& grey, double num_px) {
  return std::ceil(std::sqrt(static_cast<double>(grey.total()) / num_px));
}
// Returns by how much white grows to separate black regions that touch: one pixel of the decimated image.
int GrownPx(double decimate) { return static_cast<int>(decimate); }
cv::Mat SeparateTouching(const cv::Mat& grey, double decimate) {
  const int side_px = 2 * GrownPx(decimate) + 1;
  cv::Mat parted;
  cv::dilate(grey, parted, cv::Mat::ones(side_px, side_px, CV_8U));
  return parted;
}

// The search for the tags of one grid in one image.
class GridSearch {
 public:
  GridSearch(const TagGrid& grid, const cv::Mat& grey)
      : geometry_(grid.geometry),
        max_bit_errors_(grid.max_bit_errors),
        family_(grid.codes),
        layout_(grid.layout),
        drawing_(grid.drawing),
        grey_(grey),
        whole_(0, 0, grey.cols, grey.rows),
        fits_(grid.layout.corners_m.size()) {}

  Detection Detect() {
    if (IsTooSmall(grey_)) {
      Detection none;
      none.reason = "the image is too small";
      return none;
    }
    std::vector<cv::Rect> parts = {whole_};
    const std::vector<double> decimations = Decimations();
    // The finest pass is repeated as long as it finds tags that predict the positions of others.
    for (size_t pass = 0; !parts.empty(); ++pass) {
      const double decimate = decimations[std::min(pass, decimations.size() - 1)];
      const size_t num_before = NumKnown();
      for (const cv::Rect& part : parts) AddSeen(part, decimate);
      UpdateBoard();
      if (geometry_.corner_squares && board_.tags.size() < layout_.corners_m.size()) {
        for (const cv::Rect& part : parts) AddParted(part, decimate);
        UpdateBoard();
      }
      const bool is_new = NumKnown() > num_before;
      const bool was_seen_well = decimate <= DecimationTo(grey_, kSeenWellPx);
      const bool was_whole = parts.front() == whole_;
      parts = WhereMissing(was_seen_well);
      const bool is_whole = !parts.empty() && parts.front() == whole_;
      // The whole image is searched again only as long as finer passes find something.
      if (is_whole && was_seen_well && num_before > 0 && !is_new) break;
      if (pass + 1 >= decimations.size() && (!is_new || (is_whole && was_whole))) break;
    }
    UndoWrongFits();
    return Measured();
  }

 private:
  // The fit of a tag to all its grey values: the last start and its result.
  struct Fit {
    std::optional<TagCorners> start_px;
    std::optional<PatternFit> fit;
  };
  // The corners of a tag, of which those that could not be refined are where they were.
  struct RefinedCorners {
    TagCorners corners_px;
    bool are_all_refined = false;
  };

  bool IsSettled(int index) const { return fits_[static_cast<size_t>(index)].fit.has_value(); }
  // Returns the number of tags plus the number of settled ones.
  size_t NumKnown() const {
    const auto num_settled =
        std::count_if(board_.tags.begin(), board_.tags.end(), [&](const SeenTag& tag) { return IsSettled(tag.index); });
    return board_.tags.size() + static_cast<size_t>(num_settled);
  }

  // Returns libapriltag's quad_decimate for every pass: the first pass takes some milliseconds, the next ones are
  // finer. Tags are decoded and edges refined at full resolution in any case.
  std::vector<double> Decimations() const {
    constexpr double kFirstPx = 1e5;
    constexpr double kSlowPx = 14e6;
    // Blurred tags are found better in a coarser image.
    std::vector<double> decimations = {std::max(2.0, DecimationTo(grey_, kFirstPx))};
    const double finest = DecimationTo(grey_, kSlowPx);
    while (decimations.back() > finest) decimations.push_back(std::max(finest, std::ceil(decimations.back() / 2)));
    return decimations;
  }

  // Detects tags in a part of the image, as `part_grey` shows it. In the whole image, the regions in `searched` are
  // left out; all of a smaller part is searched, since tags are expected there.
  DetectedTags DetectIn(const cv::Rect& part, const cv::Mat& part_grey, double decimate,
                        const std::vector<cv::Rect>& searched) const {
    if (part == whole_) return family_.Detect(part_grey, decimate, searched);
    return {family_.Detect(part_grey, decimate).tags, {}};
  }

  // Adds the tags that libapriltag detects in a part of the image, with their corners refined.
  void AddSeen(const cv::Rect& part, double decimate) {
    const DetectedTags detected = DetectIn(part, grey_(part), decimate, searched_);
    searched_.insert(searched_.end(), detected.searched.begin(), detected.searched.end());
    for (const SeenTag& found : detected.tags) {
      SeenTag tag = Shifted(found, part);
      tag.corners_px = RefinedOnSquares(tag).corners_px;
      AddCandidate(tag);
    }
  }
  // Adds the tags that libapriltag detects after separating black regions.
  void AddParted(const cv::Rect& part, double decimate) {
    const DetectedTags detected = DetectIn(part, SeparateTouching(grey_(part), decimate), decimate, searched_parted_);
    searched_parted_.insert(searched_parted_.end(), detected.searched.begin(), detected.searched.end());
    for (const SeenTag& found : detected.tags) {
      SeenTag tag = Shifted(found, part);
      tag.corners_px = Offset(tag.corners_px, GrownPx(decimate));
      const RefinedCorners refined = RefinedOnSquares(tag);
      tag.corners_px = refined.corners_px;
      // The offset of the edges is a guess, not a measurement: it only gives the start for the saddles.
      if (refined.are_all_refined) AddCandidate(tag);
    }
  }

  static SeenTag Shifted(SeenTag tag, const cv::Rect& part) {
    for (Eigen::Vector2d& corner_px : tag.corners_px) corner_px += Eigen::Vector2d(part.x, part.y);
    return tag;
  }

  // Finds the same tag at the same position.
  std::vector<SeenTag>::iterator FindCandidate(const SeenTag& tag) {
    return std::find_if(candidates_.begin(), candidates_.end(), [&](const SeenTag& other) {
      return other.index == tag.index &&
             (CentreOf(other.corners_px) - CentreOf(tag.corners_px)).norm() < 0.5 * MeanSide(tag.corners_px);
    });
  }
  // Adds a candidate, or replaces a known one that is not settled: a finer pass is more accurate.
  void AddCandidate(const SeenTag& tag) {
    const auto known = FindCandidate(tag);
    if (known == candidates_.end()) {
      candidates_.push_back(tag);
    } else if (!IsSettled(tag.index) && tag.num_bit_errors <= known->num_bit_errors) {
      *known = tag;
    }
  }

  // Selects the target's tags from the candidates and fits those that are new.
  void UpdateBoard() {
    board_ = KeepConsistent(candidates_, layout_, std::max(0, max_bit_errors_ - 1));
    board_.tags = FilledIn(std::move(board_.tags));
    FitAll();
    // A settled tag is a candidate from now on, however it was found.
    for (const SeenTag& tag : Fitted()) {
      const auto known = FindCandidate(tag);
      if (known == candidates_.end()) {
        candidates_.push_back(tag);
      } else {
        *known = tag;
      }
    }
  }

  // Returns the parts of the image in which the tags that are not settled must lie; none if there is nothing left to
  // search for. Returns the whole image as long as too few tags are known to predict the others, or as long as fewer
  // than half are known and a closer look (`was_seen_well`) may show another target with more of them.
  std::vector<cv::Rect> WhereMissing(bool was_seen_well) const {
    const std::vector<SeenTag> fitted = Fitted();
    const size_t num_tags = layout_.corners_m.size();
    if (fitted.size() == num_tags) return {};
    constexpr size_t kMinTags = 4;
    if (fitted.size() < std::min(kMinTags, num_tags) || (!was_seen_well && 2 * fitted.size() < num_tags)) {
      return {whole_};
    }
    std::vector<cv::Rect> parts;
    for (int index = 0; index < static_cast<int>(layout_.corners_m.size()); ++index) {
      if (IsSettled(index)) continue;
      const std::optional<TagCorners> expected_px = Expected(fitted, index);
      if (!expected_px) continue;
      // The prediction is less accurate farther away from known tags.
      const SeenTag nearest = NearestTo(fitted, index, 1).front();
      const double num_away = (layout_.Centre(nearest.index) - layout_.Centre(index)).norm() / layout_.pitch_m;
      const double room_px = (0.75 + 0.25 * num_away) * MeanSide(*expected_px);
      Eigen::Vector2d low = (*expected_px)[0];
      Eigen::Vector2d high = low;
      for (const Eigen::Vector2d& corner_px : *expected_px) {
        low = low.cwiseMin(corner_px);
        high = high.cwiseMax(corner_px);
      }
      const double farthest_px = 2.0 * (whole_.width + whole_.height);
      if (!(low.cwiseAbs().maxCoeff() < farthest_px && high.cwiseAbs().maxCoeff() < farthest_px)) continue;
      const cv::Point first(static_cast<int>(std::floor(low.x() - room_px)),
                            static_cast<int>(std::floor(low.y() - room_px)));
      const cv::Point last(static_cast<int>(std::ceil(high.x() + room_px)),
                           static_cast<int>(std::ceil(high.y() + room_px)));
      cv::Rect part = cv::Rect(first, last) & whole_;
      if (part.empty()) continue;
      // Parts that overlap are merged.
      for (bool is_grown = true; is_grown;) {
        is_grown = false;
        for (size_t k = 0; k < parts.size() && !is_grown; ++k) {
          if ((parts[k] & part).empty()) continue;
          part |= parts[k];
          parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(k));
          is_grown = true;
        }
      }
      parts.push_back(part);
    }
    parts.erase(
        std::remove_if(parts.begin(), parts.end(),
                       [](const cv::Rect& part) { return std::min(part.width, part.height) < kMinImageSidePx; }),
        parts.end());
    return parts;
  }

  // Returns the corners of a quad after moving every edge outwards by `distance_px`.
  static TagCorners Offset(const TagCorners& before, double distance_px) {
    TagCorners corners = before;
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d from_next = (before[k] - before[(k + 1) % 4]).normalized();
      const Eigen::Vector2d from_last = (before[k] - before[(k + 3) % 4]).normalized();
      const double sine = std::abs(from_next.x() * from_last.y() - from_next.y() * from_last.x());
      if (sine > 0.1) corners[k] += distance_px / sine * (from_next + from_last);
    }
    return corners;
  }

  // Returns the corners moved to the saddles between the tag and the corner squares. Without corner squares, the
  // corners remain: they are not saddles then, and libapriltag's edges are better.
  RefinedCorners RefinedOnSquares(const SeenTag& tag) const {
    const TagCorners& start_px = tag.corners_px;
    if (!geometry_.corner_squares) return {start_px, true};
    const TagCorners& board_m = layout_.corners_m[static_cast<size_t>(tag.index)];
    const std::optional<Eigen::Matrix3d> image_from_board =
        FitHomography({board_m.begin(), board_m.end()}, {start_px.begin(), start_px.end()});
    if (!image_from_board) return {start_px, false};
    // The next edges are the far sides of the corner squares and the inner side of the tag's border.
    const double free_m = geometry_.tag_size_m * std::min(geometry_.tag_spacing_ratio,
                                                          static_cast<double>(geometry_.border_bits) / family_.width());
    const std::array<Eigen::Vector2d, 4> steps_m = {Eigen::Vector2d(free_m, 0), Eigen::Vector2d(-free_m, 0),
                                                    Eigen::Vector2d(0, free_m), Eigen::Vector2d(0, -free_m)};
    RefinedCorners refined{start_px, true};
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d at_px = ApplyHomography(*image_from_board, board_m[k]);
      double reach_px = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector2d& step_m : steps_m) {
        reach_px = std::min(reach_px, (ApplyHomography(*image_from_board, board_m[k] + step_m) - at_px).norm());
      }
      const std::optional<Eigen::Vector2d> refined_px =
          RefineCorner(grey_, start_px[k], reach_px, std::max(1.5, 0.5 * reach_px));
      refined.are_all_refined = refined.are_all_refined && refined_px.has_value();
      refined.corners_px[k] = refined_px.value_or(start_px[k]);
    }
    return refined;
  }

  // Returns the tags with the missing ones that are decoded at the positions that their neighbours predict, until no
  // more are found.
  std::vector<SeenTag> FilledIn(std::vector<SeenTag> tags) const {
    while (!tags.empty()) {
      std::vector<bool> is_seen(layout_.corners_m.size(), false);
      for (const SeenTag& tag : tags) is_seen[static_cast<size_t>(tag.index)] = true;
      std::vector<SeenTag> additional;
      for (int index = 0; index < static_cast<int>(is_seen.size()); ++index) {
        if (is_seen[static_cast<size_t>(index)] || !HasSeenNeighbour(is_seen, index)) continue;
        const std::optional<SeenTag> tag = ReadWhereExpected(tags, index);
        if (tag) additional.push_back(*tag);
      }
      if (additional.empty()) break;
      tags.insert(tags.end(), additional.begin(), additional.end());
      std::sort(tags.begin(), tags.end(), [](const SeenTag& a, const SeenTag& b) { return a.index < b.index; });
    }
    return tags;
  }

  bool HasSeenNeighbour(const std::vector<bool>& is_seen, int index) const {
    const int row = index / geometry_.columns;
    const int column = index % geometry_.columns;
    for (int r = std::max(0, row - 1); r <= std::min(geometry_.rows - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(geometry_.columns - 1, column + 1); ++c) {
        if (is_seen[static_cast<size_t>(r * geometry_.columns + c)]) return true;
      }
    }
    return false;
  }

  std::optional<SeenTag> ReadWhereExpected(const std::vector<SeenTag>& tags, int index) const {
    const std::optional<TagCorners> expected_px = Expected(tags, index);
    if (!expected_px) return std::nullopt;
    for (const Eigen::Vector2d& corner_px : *expected_px) {
      if (!IsInImage(grey_, corner_px)) return std::nullopt;
    }
    SeenTag tag;
    tag.index = index;
    tag.corners_px = *expected_px;
    // Two passes are necessary because lens distortion may put a saddle beyond the first window.
    for (int pass = 0; pass < 2; ++pass) {
      const RefinedCorners refined = geometry_.corner_squares ? RefinedOnSquares(tag) : RefinedOnEdges(tag.corners_px);
      if (!refined.are_all_refined) return std::nullopt;
      tag.corners_px = refined.corners_px;
    }
    constexpr double kMaxMoveRatio = 0.15;  // Ratio to the tag's side.
    for (size_t k = 0; k < 4; ++k) {
      if ((tag.corners_px[k] - (*expected_px)[k]).norm() > kMaxMoveRatio * MeanSide(*expected_px)) return std::nullopt;
    }
    const std::optional<int> num_bit_errors = CountBitErrors(tag);
    if (!num_bit_errors || *num_bit_errors > max_bit_errors_) return std::nullopt;
    tag.num_bit_errors = *num_bit_errors;
    return tag;
  }

  // Reads the cells between the corners and returns the number of bits that differ from the tag's code. A bit is
  // compared with the neighbouring cells of the other colour, because a shadow may fall on a part of the tag. Returns
  // nothing if the border does not contrast with the paper around it, or if a cell lies outside the image.
  std::optional<int> CountBitErrors(const SeenTag& tag) const {
    const int width = family_.width();
    const std::optional<Eigen::Matrix3d> image_from_cells =
        FitHomography({{0, width}, {width, width}, {width, 0}, {0, 0}}, {tag.corners_px.begin(), tag.corners_px.end()});
    if (!image_from_cells) return std::nullopt;
    // The cells of the tag and one more on each side. Those outside of the image are not a number.
    const int margin = family_.NumOuterCells() + 1;
    const int side = width + 2 * margin;
    cv::Mat1d levels(side, side, std::numeric_limits<double>::quiet_NaN());
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const Eigen::Vector2d at_px = ApplyHomography(*image_from_cells, {x - margin + 0.5, y - margin + 0.5});
        if (IsInImage(grey_, at_px)) levels(y, x) = GreyAt(grey_, at_px);
      }
    }
    const auto is_black = [&](int x, int y) { return family_.IsBlack(tag.index, x - margin, y - margin); };
    // Returns by how much a cell differs from another one in the direction of its colour.
    const auto contrast_at = [&](int x, int y, int other_x, int other_y) {
      return (is_black(x, y) ? -1 : 1) * (levels(y, x) - levels(other_y, other_x));
    };
    constexpr double kMinContrast = 12;  // Grey values.
    double border_contrast = 0;
    int num_border = 0;
    const int first = margin;
    const int last = margin + width - 1;
    for (int i = first; i <= last; ++i) {
      for (const double contrast : {contrast_at(i, first, i, first - 1), contrast_at(i, last, i, last + 1),
                                    contrast_at(first, i, first - 1, i), contrast_at(last, i, last + 1, i)}) {
        if (!std::isfinite(contrast)) continue;
        border_contrast += contrast;
        ++num_border;
      }
    }
    if (num_border == 0 || border_contrast < kMinContrast * num_border) return std::nullopt;
    int num_errors = 0;
    for (uint32_t bit = 0; bit < family_.num_bits(); ++bit) {
      const int x = family_.BitX(bit) + margin;
      const int y = family_.BitY(bit) + margin;
      if (!std::isfinite(levels(y, x))) return std::nullopt;
      int num_right = 0;
      int num_wrong = 0;
      for (int other_y = y - 1; other_y <= y + 1; ++other_y) {
        for (int other_x = x - 1; other_x <= x + 1; ++other_x) {
          if (is_black(other_x, other_y) == is_black(x, y) || !std::isfinite(levels(other_y, other_x))) continue;
          ++(contrast_at(x, y, other_x, other_y) > 0.25 * kMinContrast ? num_right : num_wrong);
        }
      }
      num_errors += num_wrong > num_right ? 1 : 0;
    }
    return num_errors;
  }

  // Fits the tags of the target that are not settled, each to all its grey values together. A lens that bends edges
  // misleads libapriltag by pixels: if the fit fails from its corners, it is repeated from the position that the tags
  // around it predict.
  void FitAll() {
    // A tag that is no longer on the target, or was another target's tag of the same number, is not settled.
    std::vector<Fit> fits(fits_.size());
    for (const SeenTag& tag : board_.tags) {
      Fit& known = fits_[static_cast<size_t>(tag.index)];
      const bool is_there = known.start_px && (CentreOf(*known.start_px) - CentreOf(tag.corners_px)).norm() <
                                                  0.5 * MeanSide(tag.corners_px);
      if (is_there) fits[static_cast<size_t>(tag.index)] = std::move(known);
    }
    fits_ = std::move(fits);
    const auto fit_from = [&](int index, const TagCorners& start_px) {
      Fit& known = fits_[static_cast<size_t>(index)];
      if (known.fit || known.start_px == start_px) return false;
      known.start_px = start_px;
      known.fit = FitTag(index, start_px);
      return known.fit.has_value();
    };
    for (const SeenTag& tag : board_.tags) fit_from(tag.index, tag.corners_px);
    for (bool is_new = true; is_new;) {
      is_new = false;
      const std::vector<SeenTag> fitted = Fitted();
      if (fitted.size() == board_.tags.size()) break;
      for (const SeenTag& tag : board_.tags) {
        if (IsSettled(tag.index)) continue;
        const std::optional<TagCorners> expected_px = Expected(fitted, tag.index);
        if (expected_px) is_new = fit_from(tag.index, *expected_px) || is_new;
      }
    }
  }

  // Undoes the fits that the tags around them contradict, and those whose residuals are far larger than those of the
  // other tags: a corner in glare has no grey values that hold it, and the edge of a shadow pulls it. Such a tag has
  // the corners that its edges give, near those that the others predict.
  void UndoWrongFits() {
    const std::vector<SeenTag> fitted = Fitted();
    std::vector<bool> is_wrong = ContradictNeighbours(fitted, layout_);
    std::vector<double> residual_ratios;
    for (const SeenTag& tag : fitted) {
      residual_ratios.push_back(fits_[static_cast<size_t>(tag.index)].fit->residual_ratio);
    }
    constexpr double kLargeRatio = 0.05;
    constexpr double kTimesUsual = 3;
    const double usual_ratio = fitted.empty() ? 0 : Median(residual_ratios);
    for (size_t i = 0; i < fitted.size(); ++i) {
      if (residual_ratios[i] > std::max(kLargeRatio, kTimesUsual * usual_ratio)) is_wrong[i] = true;
    }
    std::vector<SeenTag> right;
    for (size_t i = 0; i < fitted.size(); ++i) {
      if (!is_wrong[i]) right.push_back(fitted[i]);
    }
    for (size_t i = 0; i < fitted.size(); ++i) {
      if (!is_wrong[i]) continue;
      fits_[static_cast<size_t>(fitted[i].index)].fit.reset();
      const auto tag = std::find_if(board_.tags.begin(), board_.tags.end(),
                                    [&](const SeenTag& other) { return other.index == fitted[i].index; });
      const std::optional<TagCorners> expected_px = Expected(right, fitted[i].index);
      if (expected_px) tag->corners_px = *expected_px;
      tag->corners_px = RefinedOnEdges(tag->corners_px).corners_px;
    }
  }

  // Returns the corners of all tags. A tag that could not be fitted (stained, partly hidden) keeps those of its
  // detected corners that neither the tags around it nor its edges contradict.
  Detection Measured() const {
    Detection detection;
    const std::vector<SeenTag> fitted = Fitted();
    int num_unfit = 0;
    for (const SeenTag& tag : board_.tags) {
      const std::optional<PatternFit>& fit = fits_[static_cast<size_t>(tag.index)].fit;
      if (fit) {
        for (size_t corner = 0; corner < 4; ++corner) {
          detection.ids.push_back(geometry_.PointId(tag.index, corner));
          detection.pixels.push_back(fit->pixels[corner]);
        }
        detection.covariances_px2.emplace_back(fit->covariance_px2);
        continue;
      }
      const std::array<std::optional<double>, 4> sigmas_px = UnfittedSigmasPx(fitted, tag);
      for (size_t corner = 0; corner < 4; ++corner) {
        if (!sigmas_px[corner]) continue;
        detection.ids.push_back(geometry_.PointId(tag.index, corner));
        detection.pixels.push_back(tag.corners_px[corner]);
        detection.covariances_px2.emplace_back(std::pow(*sigmas_px[corner], 2) * Eigen::Matrix2d::Identity());
      }
      num_unfit +=
          std::none_of(sigmas_px.begin(), sigmas_px.end(), [](const auto& sigma) { return sigma.has_value(); });
    }
    detection.reason = Reason(num_unfit);
    return detection;
  }

  // Returns the fitted tags of the target, with the corners of the fit.
  std::vector<SeenTag> Fitted() const {
    std::vector<SeenTag> fitted;
    for (const SeenTag& tag : board_.tags) {
      const std::optional<PatternFit>& fit = fits_[static_cast<size_t>(tag.index)].fit;
      if (!fit) continue;
      fitted.push_back(tag);
      std::copy(fit->pixels.begin(), fit->pixels.end(), fitted.back().corners_px.begin());
    }
    return fitted;
  }

  // Predicts the corners of a tag from the tags nearest to it; nothing if there are none.
  std::optional<TagCorners> Expected(const std::vector<SeenTag>& tags, int index) const {
    constexpr size_t kNumNearest = 3;
    const std::optional<Eigen::Matrix3d> image_from_board =
        LocalHomography(tags, layout_, layout_.Centre(index), kNumNearest);
    if (!image_from_board) return std::nullopt;
    TagCorners expected_px;
    for (size_t k = 0; k < 4; ++k) {
      expected_px[k] = ApplyHomography(*image_from_board, layout_.corners_m[static_cast<size_t>(index)][k]);
      if (!expected_px[k].allFinite()) return std::nullopt;
    }
    return expected_px;
  }

  // Returns the approximate smallest distance between opposite sides.
  static double MinWidth(const TagCorners& corners) {
    const Eigen::Vector2d first = corners[2] - corners[0];
    const Eigen::Vector2d second = corners[3] - corners[1];
    const double area = 0.5 * std::abs(first.x() * second.y() - first.y() * second.x());
    double longest = 0;
    for (size_t k = 0; k < 4; ++k) longest = std::max(longest, (corners[(k + 1) % 4] - corners[k]).norm());
    return area / longest;
  }

  // Fits a tag to all its grey values, from corners that are correct to about a cell.
  std::optional<PatternFit> FitTag(int index, const TagCorners& start_px) const {
    const TagCorners& corners_m = layout_.corners_m[static_cast<size_t>(index)];
    const double cell_m = geometry_.tag_size_m / family_.width();
    const double gap_m = layout_.corners_m.size() > 1 || geometry_.corner_squares
                             ? geometry_.tag_size_m * geometry_.tag_spacing_ratio
                             : std::numeric_limits<double>::infinity();
    // The margin reaches at most half way to the next tag, which uses the other half. It also ends before the edge of
    // the paper around the tag, one cell away, becomes visible: the paper may lie on anything.
    constexpr double kEdgePx = 3.5;
    const double side_px = MeanSide(start_px);
    const double paper_cells = std::clamp(1 - kEdgePx * family_.width() / MinWidth(start_px), 0.3, 0.9);
    const double margin_m = std::min((family_.NumOuterCells() + paper_cells) * cell_m, 0.5 * gap_m);
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_m);
    PatternFitOptions options;
    options.min_m = corners_m[0] - margin;
    options.max_m = corners_m[2] + margin;
    constexpr double kMinLensPx = 16;
    options.freedom = side_px < kMinLensPx ? MapFreedom::kAffine : MapFreedom::kStrongLens;
    options.max_move_px = std::max(2.0, 0.1 * side_px);
    const std::optional<Eigen::Matrix3d> image_from_board =
        FitHomography({corners_m.begin(), corners_m.end()}, {start_px.begin(), start_px.end()});
    if (!image_from_board) return std::nullopt;
    return FitPattern(grey_, CellsOf(drawing_, options.min_m - margin, options.max_m + margin), *image_from_board,
                      {corners_m.begin(), corners_m.end()}, options);
  }

  // Returns the sigmas of the corners of a tag that could not be fitted; nothing for those that the tags around it or
  // the two edges that meet there contradict.
  std::array<std::optional<double>, 4> UnfittedSigmasPx(const std::vector<SeenTag>& fitted, const SeenTag& tag) const {
    double most_off_px = std::numeric_limits<double>::infinity();
    const std::optional<std::array<double, 4>> off_px = OffNeighboursPx(fitted, tag);
    if (off_px) {
      // The fitted tags show the error that perspective and lens distortion cause in such predictions.
      constexpr size_t kNumJudged = 4;
      double usual_px = 0;
      for (const SeenTag& other : NearestTo(fitted, tag.index, kNumJudged)) {
        const std::optional<std::array<double, 4>> others_px = OffNeighboursPx(fitted, other);
        usual_px = std::max(usual_px, others_px ? *std::max_element(others_px->begin(), others_px->end())
                                                : 0.05 * MeanSide(other.corners_px));
      }
      most_off_px = 2 * usual_px + 1;
    }
    const double most_off_edges_px = std::max(1.0, 0.1 * MeanSide(tag.corners_px) / family_.width());
    // libapriltag's edges scatter by 0.04 px under good conditions.
    constexpr double kMinSigmaPx = 0.1;
    const std::array<double, 4> off_edges_px = OffEdgesPx(tag.corners_px);
    std::array<std::optional<double>, 4> sigmas_px;
    for (size_t k = 0; k < 4; ++k) {
      const double off_here_px = std::max(off_edges_px[k], off_edges_px[(k + 3) % 4]);
      if (off_here_px > most_off_edges_px || (off_px && (*off_px)[k] > most_off_px)) continue;
      sigmas_px[k] = std::max(kMinSigmaPx, 2 * off_here_px);
    }
    return sigmas_px;
  }

  std::vector<SeenTag> NearestTo(std::vector<SeenTag> tags, int index, size_t count) const {
    const auto distance_m = [&](const SeenTag& tag) {
      return (layout_.Centre(tag.index) - layout_.Centre(index)).norm();
    };
    std::stable_sort(tags.begin(), tags.end(),
                     [&](const SeenTag& a, const SeenTag& b) { return distance_m(a) < distance_m(b); });
    if (tags.size() > count) tags.resize(count);
    return tags;
  }

  // Returns the distances of a tag's corners from those that the other tags predict; nothing without others.
  std::optional<std::array<double, 4>> OffNeighboursPx(std::vector<SeenTag> others, const SeenTag& tag) const {
    others.erase(
        std::remove_if(others.begin(), others.end(), [&](const SeenTag& other) { return other.index == tag.index; }),
        others.end());
    const std::optional<TagCorners> expected_px = Expected(others, tag.index);
    if (!expected_px) return std::nullopt;
    std::array<double, 4> off_px{};
    for (size_t k = 0; k < 4; ++k) off_px[k] = (tag.corners_px[k] - (*expected_px)[k]).norm();
    return off_px;
  }

  // The side of a tag that follows a corner.
  struct Side {
    Eigen::Vector2d from_px;
    Eigen::Vector2d to_px;
    Eigen::Vector2d outwards;  // A unit vector across it.
  };
  static Side SideOf(const TagCorners& corners_px, size_t corner) {
    Side side{corners_px[corner], corners_px[(corner + 1) % 4], {}};
    side.outwards = Eigen::Vector2d(side.from_px.y() - side.to_px.y(), side.to_px.x() - side.from_px.x()).normalized();
    if (side.outwards.dot(side.from_px - CentreOf(corners_px)) < 0) side.outwards = -side.outwards;
    return side;
  }

  // A position on a side of a tag, as a share of its length, where grey changes most across it.
  struct EdgePoint {
    double along = 0;
    double off_px = 0;  // The distance from the straight line between the corners, outwards.
  };

  // Returns the points where grey changes most, in either direction, within 0.8 cells of the side that follows a
  // corner.
  std::vector<EdgePoint> EdgePoints(const TagCorners& corners_px, size_t corner) const {
    constexpr double kStepPx = 0.25;
    const double reach_px = 0.8 * MeanSide(corners_px) / family_.width();
    const Side side = SideOf(corners_px, corner);
    std::vector<EdgePoint> points;
    for (double share = 0.1; share < 0.95; share += 0.1) {
      EdgePoint point{share};
      double steepest = 0;  // Grey values per px; it stays 0 if the image ends there.
      for (double at_px = -reach_px; at_px <= reach_px; at_px += kStepPx) {
        const Eigen::Vector2d before_px =
            side.from_px + share * (side.to_px - side.from_px) + (at_px - 0.5) * side.outwards;
        const Eigen::Vector2d behind_px = before_px + side.outwards;
        if (!IsInImage(grey_, before_px) || !IsInImage(grey_, behind_px)) continue;
        const double slope = std::abs(GreyAt(grey_, behind_px) - GreyAt(grey_, before_px));
        if (slope <= steepest) continue;
        steepest = slope;
        point.off_px = at_px;
      }
      points.push_back(point);
    }
    return points;
  }

  // Returns, for the side that follows each corner, the RMS distance from the straight line between the corners to the
  // steepest change of grey across it.
  std::array<double, 4> OffEdgesPx(const TagCorners& corners_px) const {
    std::array<double, 4> off_px{};
    for (size_t k = 0; k < 4; ++k) {
      const std::vector<EdgePoint> points = EdgePoints(corners_px, k);
      double sum_px2 = 0;
      for (const EdgePoint& point : points) sum_px2 += point.off_px * point.off_px;
      off_px[k] = std::sqrt(sum_px2 / static_cast<double>(points.size()));
    }
    return off_px;
  }

  // Returns the corners moved to where straight lines along the sides meet, unless a side cannot be told. Of each side,
  // the half of the points that lie nearest to a line count: where a shadow ends, other points are not on the side.
  RefinedCorners RefinedOnEdges(const TagCorners& corners_px) const {
    RefinedCorners refined{corners_px, false};
    std::array<Eigen::Vector3d, 4> lines;
    for (size_t k = 0; k < 4; ++k) {
      const std::vector<EdgePoint> points = EdgePoints(corners_px, k);
      // The line through two of the points from which the median of the distances is least.
      double least_px = std::numeric_limits<double>::infinity();
      Eigen::Vector2d best(0, 0);  // The distance at the beginning and at the end.
      for (size_t i = 0; i < points.size(); ++i) {
        for (size_t j = i + 1; j < points.size(); ++j) {
          const double slope = (points[j].off_px - points[i].off_px) / (points[j].along - points[i].along);
          const Eigen::Vector2d line(points[i].off_px - slope * points[i].along,
                                     points[i].off_px + slope * (1 - points[i].along));
          std::vector<double> distances_px;
          for (const EdgePoint& point : points) {
            distances_px.push_back(std::abs(point.off_px - line[0] - (line[1] - line[0]) * point.along));
          }
          const auto half = distances_px.begin() + static_cast<std::ptrdiff_t>(points.size() / 2 + 1);
          std::nth_element(distances_px.begin(), half, distances_px.end());
          if (*half >= least_px) continue;
          least_px = *half;
          best = line;
        }
      }
      constexpr double kMaxScatterPx = 0.75;
      if (least_px > kMaxScatterPx) return refined;
      const Side side = SideOf(corners_px, k);
      lines[k] = (side.from_px + best[0] * side.outwards)
                     .homogeneous()
                     .cross((side.to_px + best[1] * side.outwards).homogeneous());
    }
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d corner = lines[(k + 3) % 4].cross(lines[k]);
      if (std::abs(corner.z()) < 1e-9 * lines[k].norm()) return refined;
      refined.corners_px[k] = corner.hnormalized();
    }
    refined.are_all_refined = true;
    return refined;
  }

  std::string Reason(int num_unfit) const {
    const size_t num_tags = layout_.corners_m.size();
    std::string reason;
    if (board_.tags.empty()) {
      reason = "no tag of the target found";
    } else if (board_.tags.size() < num_tags) {
      reason = std::to_string(board_.tags.size()) + " of " + std::to_string(num_tags) + " tags seen";
    }
    if (board_.num_dropped > 0) {
      reason += std::string(reason.empty() ? "" : "; ") + std::to_string(board_.num_dropped) +
                " tags left out that do not fit the target (another target in view?)";
    }
    if (num_unfit > 0) {
      reason += std::string(reason.empty() ? "" : "; ") + std::to_string(num_unfit) +
                " tags left out that do not look as drawn and contradict their edges or the tags around them";
    }
    return reason;
  }

  const TagGridGeometry& geometry_;
  const int max_bit_errors_;
  const TagCodes& family_;
  const TagLayout& layout_;
  const Drawing& drawing_;
  const cv::Mat& grey_;
  const cv::Rect whole_;

  // The state of the search, pass by pass.
  std::vector<SeenTag> candidates_;
  ConsistentTags board_;   // Candidates that are consistent.
  std::vector<Fit> fits_;  // One fit per tag of the target.
  // Large regions in which libapriltag has searched for tags, in the image and in the image with separated regions.
  std::vector<cv::Rect> searched_;
  std::vector<cv::Rect> searched_parted_;
};

}  // namespace

Detection DetectTagGrid(const cv::Mat& grey, const TagGrid& grid) { return GridSearch(grid, grey).Detect(); }

std::vector<int> SeenTagIds(const cv::Mat& grey, const TagGrid& grid) {
  if (IsTooSmall(grey)) return {};
  TagFamily family(*FindEntry(kTagFamilies, grid.geometry.family));
  TagGridGeometry all = grid.geometry;
  all.first_id = 0;
  all.rows = 1;
  all.columns = static_cast<int>(family->ncodes);
  std::vector<int> ids;
  const TagCodes every(std::move(family), all, 0);
  constexpr double kEnoughPx = 3e6;
  const double decimate = DecimationTo(grey, kEnoughPx);
  for (const SeenTag& tag : every.Detect(grey, decimate).tags) ids.push_back(tag.index);
  if (grid.geometry.corner_squares) {
    for (const SeenTag& tag : every.Detect(SeparateTouching(grey, decimate), decimate).tags) ids.push_back(tag.index);
  }
  return ids;
}

}  // namespace heba
