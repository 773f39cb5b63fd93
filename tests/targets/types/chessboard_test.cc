// Tests of chessboards: the orders in which they can be read, rendered images and images recorded by others.
#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "targets/images/image.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/recorded_boards.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

std::unique_ptr<Target> MakeBoard(int rows, int columns) {
  return MakeTarget("{type: chessboard, rows: " + std::to_string(rows) + ", columns: " + std::to_string(columns) +
                    ", square: 20 mm}");
}

struct SizeOfBoard {
  int rows;
  int columns;
  size_t num_orders;  // Number of orders that leave the colours unchanged.
};
const std::vector<SizeOfBoard> kBoards = {{5, 8, 1}, {6, 8, 2}, {5, 7, 2}, {6, 6, 4}, {5, 5, 2}, {3, 4, 1}};

TEST(Chessboard, SymmetriesKeepColours) {
  for (const SizeOfBoard& size : kBoards) {
    const std::unique_ptr<Target> target = MakeBoard(size.rows, size.columns);
    const std::vector<Rigid3d> symmetries = target->Symmetries();
    EXPECT_EQ(symmetries.size(), size.num_orders) << size.rows << " x " << size.columns;
    EXPECT_THAT(symmetries.front(), IsNearPose(Rigid3d(), 0.0, 0.0));
    // A black square stays black: its centre moves to the centre of a square on the same diagonals.
    for (const Rigid3d& symmetry : symmetries) {
      const Eigen::Vector3d moved = symmetry * Eigen::Vector3d(-0.01, -0.01, 0) / 0.02;
      EXPECT_EQ((std::lround(moved.x() - 0.5) + std::lround(moved.y() - 0.5)) % 2, 0);
    }
  }
}

TEST(Chessboard, FindsRenderedTargetsAccurately) {
  for (const SizeOfBoard& size : kBoards) {
    const std::unique_ptr<Target> target = MakeBoard(size.rows, size.columns);
    const int num_views = 3;
    const DetectionErrors errors = DetectRendered(*target, num_views, 0.8, /*seed=*/21);
    EXPECT_EQ(errors.num_found, num_views * target->points().size()) << size.rows << " x " << size.columns;
    EXPECT_EQ(errors.num_unknown_ids, 0U);
    // Noise of 2 grey levels causes about 0.02 px; the rest is lens distortion within the window.
    EXPECT_LT(errors.BiasPx(), 0.02) << size.rows << " x " << size.columns;
    EXPECT_LT(errors.RmsPx(), 0.05) << size.rows << " x " << size.columns;
  }
}

// The pixels are purely black or white. The corners are more accurate than those of OpenCV's finder with its accuracy
// option. The stated covariance is not too small but too large, because the steps that alternate along an edge cancel
// each other.
TEST(ChessboardNightly, IsAccurateWithoutAntiAliasing) {
  constexpr int kRows = 5;
  constexpr int kColumns = 8;
  const std::unique_ptr<Target> target = MakeBoard(kRows, kColumns);
  const Camera camera = ImageCamera();
  DetectionErrors own;
  DetectionErrors of_opencv;
  double chi2 = 0;
  for (int view = 0; view < 6; ++view) {
    Rng rng(26, static_cast<uint64_t>(view));
    const Rigid3d camera_from_target = RandomView(target->Draw(), 0.8, 0.7, 0.6, rng);
    RenderOptions options;
    options.is_point_sampled = true;
    options.noise_sigma_grey = 2;
    options.seed = static_cast<uint64_t>(view);
    const cv::Mat grey = RenderView(target->Draw(), camera, camera_from_target, options);
    Detection detection = target->Detect(grey);
    ASSERT_EQ(detection.ids.size(), target->points().size());
    own.Add(ErrorsOf(*target, camera, camera_from_target, detection));
    for (size_t i = 0; i < detection.ids.size(); ++i) {
      const Eigen::Vector2d truth_px = PixelOf(target->points()[i], camera, camera_from_target).value();
      const Eigen::Vector2d error_px = detection.pixels[i] - truth_px;
      chi2 += error_px.dot(detection.covariances_px2[i].inverse() * error_px);
    }
    std::vector<cv::Point2f> corners;
    ASSERT_TRUE(cv::findChessboardCornersSB(grey, {kColumns, kRows}, corners, cv::CALIB_CB_ACCURACY));
    for (size_t i = 0; i < corners.size(); ++i) detection.pixels[i] = {corners[i].x, corners[i].y};
    of_opencv.Add(ErrorsOf(*target, camera, camera_from_target, detection));
  }
  RecordProperty("rms_px", std::to_string(own.RmsPx()));
  RecordProperty("opencv_rms_px", std::to_string(of_opencv.RmsPx()));
  EXPECT_LT(own.RmsPx(), of_opencv.RmsPx());
  EXPECT_LT(chi2 / (2.0 * static_cast<double>(own.num_found)), 2);
  EXPECT_GT(chi2 / (2.0 * static_cast<double>(own.num_found)), 0.08);
}

// A target with only one possible order is read in this order, however it is rotated.
TEST(Chessboard, ColoursDetermineTheOrder) {
  const std::unique_ptr<Target> target = MakeBoard(5, 8);
  const Camera camera = ImageCamera();
  for (int quarter = 0; quarter < 4; ++quarter) {
    Rng rng(22, static_cast<uint64_t>(quarter));
    const Eigen::Vector3d middle_m(0.07, 0.04, 0);
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.1 + quarter * M_PI / 2, Eigen::Vector3d::UnitZ()));
    const Rigid3d camera_from_target(turn, Eigen::Vector3d(0, 0, 0.3) - turn * middle_m);
    const Detection detection = target->Detect(RenderView(target->Draw(), camera, camera_from_target));
    const DetectionErrors errors = ErrorsOf(*target, camera, camera_from_target, detection);
    EXPECT_EQ(errors.num_found, 40U);
    EXPECT_LT(errors.max_px, 0.2) << "turned by " << quarter << " quarters";
  }
}

// A dark object behind a rim that is narrower than a square makes the rim look like an additional row of squares.
TEST(Chessboard, RimIsNotTakenForARow) {
  const std::unique_ptr<Target> target = MakeBoard(4, 3);
  const Camera camera = ImageCamera();
  Drawing drawing = target->Draw();
  drawing.min_m += Eigen::Vector2d(0.014, 0.014);  // 6 mm of the 20 mm rim remain.
  drawing.max_m -= Eigen::Vector2d(0.014, 0.014);
  for (int view = 0; view < 4; ++view) {
    Rng rng(23, static_cast<uint64_t>(view));
    const Rigid3d camera_from_target = RandomView(target->Draw(), 0.5, 0.5, 0.5, rng);
    RenderOptions options;
    options.background_albedo = 0;
    const Detection detection = target->Detect(RenderView(drawing, camera, camera_from_target, options));
    const DetectionErrors errors = ErrorsOf(*target, camera, camera_from_target, detection);
    EXPECT_LT(errors.max_px, 0.2);
    EXPECT_EQ(errors.num_found, 12U);
  }
}

TEST(Chessboard, FindsNothingWithoutTarget) {
  const std::unique_ptr<Target> target = MakeBoard(5, 8);
  const std::unique_ptr<Target> other = MakeBoard(3, 4);
  Rng rng(24);
  const Detection detection =
      target->Detect(RenderView(other->Draw(), ImageCamera(), RandomView(other->Draw(), 0.7, 0.4, 0.4, rng)));
  EXPECT_THAT(detection.ids, IsEmpty());
  EXPECT_THAT(detection.reason, HasSubstr("no chessboard of 5 x 8"));
}

// The noise of a blank wall is not searched for quads. The finders would take minutes, and the time limit of the test
// would end it.
TEST(Chessboard, DoesNotSearchABlankWall) {
  const std::unique_ptr<Target> target = MakeBoard(5, 8);
  cv::Mat wall(1080, 1920, CV_8UC1);
  cv::RNG random(25);
  random.fill(wall, cv::RNG::NORMAL, 120, 5);
  EXPECT_THAT(target->Detect(wall).reason, HasSubstr("no chessboard of 5 x 8"));
}

// An image of a target with something drawn over it, and its ground truth.
struct CoveredView {
  Camera camera = ImageCamera();
  Rigid3d camera_from_target;
  cv::Mat grey;
  cv::Mat cover;  // Non-zero at covered pixels.

  CoveredView(const Target& target, int view) {
    Rng rng(27, static_cast<uint64_t>(view));
    camera_from_target = RandomView(target.Draw(), 0.8, 0.5, 0.4, rng);
    RenderOptions options;
    options.noise_sigma_grey = 2;
    options.seed = static_cast<uint64_t>(view);
    grey = RenderView(target.Draw(), camera, camera_from_target, options);
    cover = cv::Mat::zeros(grey.size(), CV_8U);
  }
  cv::Point At(double x_squares, double y_squares) const {
    const Eigen::Vector2d pixel =
        ProjectPoint(camera, camera_from_target * Eigen::Vector3d(0.02 * x_squares, 0.02 * y_squares, 0)).value();
    return {static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y()))};
  }
  void Line(const std::vector<cv::Point>& points, int width_px, int level) {
    for (size_t i = 0; i + 1 < points.size(); ++i) {
      cv::line(grey, points[i], points[i + 1], level, width_px, cv::LINE_AA);
      cv::line(cover, points[i], points[i + 1], 255, width_px);
    }
  }
};

struct CoveredCorners {
  int num_wrong = 0;     // Found at a wrong position.
  int num_unseen = 0;    // Found although covered.
  int num_missed = 0;    // Not found although the cover is more than 0.8 squares away.
  int num_left_out = 0;  // Not found.
  double largest_error_px = 0;
};
CoveredCorners Judge(const Target& target, const CoveredView& view, const Detection& detection) {
  cv::Mat distance_px;
  cv::distanceTransform(255 - view.cover, distance_px, cv::DIST_L2, 5);
  const double square_px = cv::norm(view.At(1, 1) - view.At(0, 1));
  CoveredCorners result;
  for (const TargetPoint& point : target.points()) {
    const Eigen::Vector2d truth_px = PixelOf(point, view.camera, view.camera_from_target).value();
    const auto away_px =
        distance_px.at<float>(static_cast<int>(std::lround(truth_px.y())), static_cast<int>(std::lround(truth_px.x())));
    const auto found = std::find(detection.ids.begin(), detection.ids.end(), point.id);
    if (found == detection.ids.end()) {
      ++result.num_left_out;
      result.num_missed += away_px > 0.8 * square_px ? 1 : 0;
      continue;
    }
    const double error_px = (detection.pixels[static_cast<size_t>(found - detection.ids.begin())] - truth_px).norm();
    result.largest_error_px = std::max(result.largest_error_px, error_px);
    result.num_wrong += error_px > 0.5 ? 1 : 0;
    result.num_unseen += away_px == 0 ? 1 : 0;
  }
  return result;
}

TEST(Chessboard, FindsTheCornersBesideACable) {
  const std::unique_ptr<Target> target = MakeBoard(7, 10);
  for (const int level : {10, 120, 240}) {
    for (int i = 0; i < 2; ++i) {
      CoveredView view(*target, i);
      view.Line({view.At(-3, 1.2), view.At(2.4, 2.7), view.At(5.2, 3.1), view.At(7.5, 5.6), view.At(9, 9)}, 14, level);
      const Detection detection = target->Detect(view.grey);
      const CoveredCorners judged = Judge(*target, view, detection);
      EXPECT_EQ(judged.num_wrong, 0) << "level " << level << ", view " << i;
      EXPECT_EQ(judged.num_unseen, 0) << "level " << level << ", view " << i;
      EXPECT_EQ(judged.num_missed, 0) << "level " << level << ", view " << i << ": " << detection.reason;
      EXPECT_GT(judged.num_left_out, 0) << "level " << level << ", view " << i;
      EXPECT_LT(judged.largest_error_px, 0.3) << "level " << level << ", view " << i;
    }
  }
}

// Takes 70 % of the light from the part of an image beyond a line through its middle; the edge is 8 px wide.
void Shadow(double angle_rad, cv::Mat* grey) {
  for (int y = 0; y < grey->rows; ++y) {
    for (int x = 0; x < grey->cols; ++x) {
      const double side_px =
          (x - 0.5 * grey->cols) * std::cos(angle_rad) + (y - 0.5 * grey->rows) * std::sin(angle_rad);
      const double light = 1 - 0.35 * (1 + std::tanh(side_px / 4));
      grey->at<uchar>(y, x) = cv::saturate_cast<uchar>(light * grey->at<uchar>(y, x));
    }
  }
}

TEST(Chessboard, FindsTheCornersAcrossTheEdgeOfAShadow) {
  const std::unique_ptr<Target> target = MakeBoard(6, 9);
  for (int i = 0; i < 12; ++i) {
    CoveredView view(*target, i);
    Shadow(0.5 * i, &view.grey);
    const Detection detection = target->Detect(view.grey);
    const CoveredCorners judged = Judge(*target, view, detection);
    EXPECT_EQ(judged.num_left_out, 0) << "view " << i << ": " << detection.reason;
    EXPECT_LT(judged.largest_error_px, 0.5) << "view " << i;
  }
}

TEST(Chessboard, FindsTheCornersBesideFingers) {
  const std::unique_ptr<Target> target = MakeBoard(7, 10);
  for (int i = 0; i < 3; ++i) {
    CoveredView view(*target, i);
    for (const double x : {2.2, 3.6, 5.0}) view.Line({view.At(x, -4), view.At(x - 0.3, 1.3)}, 32, 150);
    const Detection detection = target->Detect(view.grey);
    const CoveredCorners judged = Judge(*target, view, detection);
    EXPECT_EQ(judged.num_wrong, 0) << "view " << i;
    EXPECT_EQ(judged.num_unseen, 0) << "view " << i;
    EXPECT_EQ(judged.num_missed, 0) << "view " << i << ": " << detection.reason;
    EXPECT_THAT(detection.reason, HasSubstr("corners are covered"));
  }
}

// Rows and columns cannot be counted if an outer row or column is covered, on any side.
TEST(Chessboard, RefusesACoveredOuterRow) {
  const std::unique_ptr<Target> target = MakeBoard(7, 10);
  for (int side = 0; side < 4; ++side) {
    CoveredView view(*target, side);
    const double x = side == 0 ? 0 : 9;
    const double y = side == 2 ? 0 : 6;
    const std::vector<cv::Point> line = side < 2 ? std::vector<cv::Point>{view.At(x, -2), view.At(x, 8)}
                                                 : std::vector<cv::Point>{view.At(-2, y), view.At(11, y)};
    view.Line(line, 30, 150);
    const Detection detection = target->Detect(view.grey);
    EXPECT_THAT(detection.ids, IsEmpty()) << "side " << side;
    EXPECT_THAT(detection.reason, HasSubstr("visible corners are ambiguous")) << "side " << side;
  }
}

TEST(Chessboard, RejectsTooFewCorners) {
  EXPECT_THAT(InputErrorOf([] { MakeBoard(2, 5); }), HasSubstr("rows"));
}

// The RMS of a calibration from the images themselves reveals wrong and inaccurate corners; the bounds are a fifth
// above the measured values.
TEST(Chessboard, FindsRecordedSmallTargetsOnly) {
  const std::filesystem::path folder = DataDir() / "metric_workcell_camera2" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const std::set<std::string> without_board = {"0001.png", "0089.png", "0177.png"};
  std::set<std::string> always = without_board;
  // These images show the target at its smallest and steepest, or have a rim that was once taken for a row.
  always.insert({"0040.png", "0042.png", "0076.png", "0091.png", "0098.png", "0116.png", "0221.png", "0246.png"});
  const RecordedBoards found = DetectRecorded(*MakeBoard(4, 3), folder, /*step=*/15, always);
  EXPECT_EQ(found.not_found, without_board);
  EXPECT_THAT(found.incomplete, IsEmpty());
  EXPECT_LT(found.rms_px, 0.12);
}

TEST(Chessboard, FindsRecordedTargetsWithDots) {
  const std::filesystem::path folder = DataDir() / "caliban_no_curv" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const RecordedBoards found = DetectRecorded(*MakeBoard(9, 14), folder, /*step=*/5);
  EXPECT_THAT(found.not_found, IsEmpty());
  EXPECT_THAT(found.incomplete, IsEmpty());
  EXPECT_LT(found.rms_px, 0.06);
}

TEST(Chessboard, FindsRecordedTargetsInTheDark) {
  const std::filesystem::path folder = DataDir() / "chjohnkim_ur5_chess" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const RecordedBoards found = DetectRecorded(*MakeBoard(9, 11), folder, /*step=*/2);
  EXPECT_THAT(found.not_found, IsEmpty());
  EXPECT_THAT(found.incomplete, IsEmpty());
  EXPECT_LT(found.rms_px, 0.2);
}

}  // namespace
}  // namespace heba
