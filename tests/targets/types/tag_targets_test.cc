// Tests of AprilTag grids: their frame, their drawings, and images recorded by others.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <ostream>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "targets/images/image.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::unique_ptr<Target> MakeGrid(const std::string& family, int rows, int columns, const std::string& more) {
  return MakeTarget("{type: apriltag_grid, family: " + family + ", rows: " + std::to_string(rows) +
                    ", columns: " + std::to_string(columns) + ", tag_size: 30 mm" + more + "}");
}

std::set<int> TagsOf(const Detection& detection) {
  std::set<int> tags;
  for (const int id : detection.ids) tags.insert(id / 4);
  return tags;
}

class FamilyTest : public testing::TestWithParam<std::string> {};

// Detect() finds the tags that Draw() prints. The test covers bits, orientation, order and half-pixel offsets.
TEST_P(FamilyTest, FindsRenderedTagsAccurately) {
  const bool has_outer_cells = GetParam().size() > 9;  // tagCircle..., tagCustom..., tagStandard...
  const std::unique_ptr<Target> target = MakeGrid(GetParam(), 2, 3, has_outer_cells ? ", tag_spacing: 2" : "");
  const int num_views = 3;
  const DetectionErrors errors = DetectRendered(*target, num_views, 0.8, /*seed=*/11);
  EXPECT_EQ(errors.num_found, num_views * target->points().size());
  EXPECT_EQ(errors.num_unknown_ids, 0U);
  // Points are saddle points if there are corner squares. Otherwise they come from libapriltag's edges, which are
  // less accurate, particularly inside the tag.
  EXPECT_LT(errors.BiasPx(), 0.05);
  EXPECT_LT(errors.RmsPx(), has_outer_cells ? 0.25 : 0.1);
}

INSTANTIATE_TEST_SUITE_P(All, FamilyTest,
                         testing::Values("tag16h5", "tag25h9", "tag36h10", "tag36h11", "tagCircle21h7",
                                         "tagCircle49h12", "tagCustom48h12", "tagStandard41h12", "tagStandard52h13"));

TEST(AprilTagGrid, FindsAllTagsOfKalibrsSheet) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 6, 6, ", border_bits: 2");
  const int num_views = 4;
  const DetectionErrors errors = DetectRendered(*target, num_views, 0.7, /*seed=*/12);
  EXPECT_EQ(errors.num_found, num_views * target->points().size());
  EXPECT_LT(errors.BiasPx(), 0.05);
  EXPECT_LT(errors.RmsPx(), 0.1);
}

TEST(AprilTagGrid, PlainTagsAreFoundByTheirEdges) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 3, 4, ", corner_squares: false, first_id: 100");
  const int num_views = 4;
  const DetectionErrors errors = DetectRendered(*target, num_views, 0.7, /*seed=*/13);
  EXPECT_EQ(errors.num_found, num_views * target->points().size());
  EXPECT_LT(errors.BiasPx(), 0.05);
  EXPECT_LT(errors.RmsPx(), 0.2);
}

// Returns the square root of the ratio of e' C^-1 e to its expectation, for the `index`-th of the detected tags.
double NormalisedError(const Target& target, const Camera& camera, const Rigid3d& camera_from_target,
                       const Detection& detection, size_t index) {
  Eigen::VectorXd error_px(8);
  for (size_t k = 0; k < 4; ++k) {
    const auto point = static_cast<size_t>(detection.ids[4 * index + k] - target.points().front().id);
    error_px.segment<2>(2 * static_cast<Eigen::Index>(k)) =
        detection.pixels[4 * index + k] - PixelOf(target.points()[point], camera, camera_from_target).value();
  }
  return std::sqrt(MahalanobisSquare(error_px, detection.covariances_px2[index]) / 8);
}

// Takes 70 % of the light from the right half of an image; the edge of the shadow is 8 px wide.
cv::Mat Shadowed(cv::Mat grey) {
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double light = 1 - 0.35 * (1 + std::tanh((x - 0.5 * grey.cols) / 4));
      grey.at<uchar>(y, x) = cv::saturate_cast<uchar>(light * grey.at<uchar>(y, x));
    }
  }
  return grey;
}

// libapriltag does not find the tags that the edge of a shadow crosses: they are read where the others predict them.
TEST(AprilTagGrid, ReadsTagsAcrossTheEdgeOfAShadow) {
  for (const std::string family : {"tag36h11, corner_squares: false", "tagStandard41h12, tag_spacing: 2"}) {
    const std::unique_ptr<Target> target = MakeGrid(family, 3, 4, "");
    Rng rng(31);
    RenderOptions options;
    options.noise_sigma_grey = 2;
    constexpr int kNumViews = 4;
    size_t num_tags = 0;
    for (int view = 0; view < kNumViews; ++view) {
      options.seed = static_cast<uint64_t>(view);
      const Rigid3d pose = RandomView(target->Draw(), 0.7, 0.6, 1, rng);
      const Detection detection = target->Detect(Shadowed(RenderView(target->Draw(), ImageCamera(), pose, options)));
      num_tags += TagsOf(detection).size();
      EXPECT_LT(ErrorsOf(*target, ImageCamera(), pose, detection).max_px, 2) << family << ", view " << view;
    }
    EXPECT_GE(num_tags, kNumViews * 12 - 2) << family;
  }
}

// A lens with f = 600 px bends the edges of a tag whose corner square is cut off by the side of the image, so the
// corners of libapriltag are off by 5 to 32 px. The tags around it either predict its corners, from which it is
// fitted, or show that it is not where it was detected.
TEST(AprilTagGrid, NeighboursCorrectTagsBentByTheLens) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 4, 4, "");
  const Eigen::Vector2d middle_m = 0.5 * (target->Draw().min_m + target->Draw().max_m);
  struct Lens {
    double k1;
    double k2;
    size_t num_tags;
    bool is_dropped;
  };
  for (const Lens& lens : {Lens{-0.18, 0, 14, true}, Lens{-0.2, 0.03, 14, false}, Lens{-0.25, 0.05, 15, false}}) {
    const Camera camera{"brown5", 1280, 960, {600, 600, 639.5, 479.5, lens.k1, lens.k2, 0, 0, 0}};
    Rng rng(777, 4);
    const double tilt_rad = rng.Uniform(0.1, 0.8);
    const double towards_rad = rng.Uniform(-kPi, kPi);
    const Eigen::Quaterniond rotation =
        ExpRotation(tilt_rad * Eigen::Vector3d(std::cos(towards_rad), std::sin(towards_rad), 0)) *
        ExpRotation(rng.Uniform(-3, 3) * Eigen::Vector3d::UnitZ()) * ExpRotation(kPi * Eigen::Vector3d::UnitX());
    const double distance_m = rng.Uniform(0.12, 0.3);
    const double down_m = rng.Uniform(-0.25, 0.25) * distance_m;
    const double right_m = rng.Uniform(-0.35, 0.35) * distance_m;
    const Rigid3d camera_from_target(rotation, Eigen::Vector3d(right_m, down_m, distance_m) -
                                                   rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
    RenderOptions options;
    options.noise_sigma_grey = 2;
    options.seed = 4;
    const Detection detection = target->Detect(RenderView(target->Draw(), camera, camera_from_target, options));
    EXPECT_EQ(detection.reason.find("contradict their edges or the tags around them") != std::string::npos,
              lens.is_dropped)
        << detection.reason;
    EXPECT_EQ(TagsOf(detection).size(), lens.num_tags) << detection.reason;
    // Error that such a lens leaves within tags of 140 px.
    EXPECT_LT(ErrorsOf(*target, camera, camera_from_target, detection).max_px, 0.3) << lens.k1;
  }
}

// Adds specks between the cells of the tag whose bottom left corner is `first_m`; it stays readable.
void AddSpecks(const Eigen::Vector2d& first_m, Drawing* drawing) {
  constexpr double kCellM = 0.03 / 8;
  for (int row = 2; row < 7; ++row) {
    for (int column = 2; column < 7; ++column) {
      drawing->AddDisc(first_m + kCellM * Eigen::Vector2d(column, row), 0.4 * kCellM, (row + column) % 2);
    }
  }
}

// The number of tags on each side of the grid, and the index of a random view.
class StainedTagTest : public testing::TestWithParam<std::tuple<int, uint64_t>> {};

// Specks between the cells leave a tag readable but different from its drawing: its corners are then those of its
// edges, and their covariance allows for edges that are not straight.
TEST_P(StainedTagTest, HasALargerCovariance) {
  const auto& [side, view] = GetParam();
  const Camera camera = ImageCamera();
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", side, side, ", corner_squares: false");
  Drawing drawing = target->Draw();
  const auto stained = static_cast<size_t>(side * side / 2);
  AddSpecks(target->points()[4 * stained].in_target.head<2>(), &drawing);
  Rng rng(16, view);
  const Rigid3d camera_from_target = RandomView(drawing, 0.2 + 0.2 * side, 0.5, 0.5, rng);
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.seed = view;
  const Detection detection = target->Detect(RenderView(drawing, camera, camera_from_target, options));
  ASSERT_EQ(detection.ids.size(), target->points().size()) << detection.reason;
  const Eigen::MatrixXd& stained_px2 = detection.covariances_px2[stained];
  EXPECT_GE(std::sqrt(stained_px2(0, 0)), 0.1);
  EXPECT_TRUE(stained_px2.isDiagonal());
  // For 8 coordinates a value of 2.1 is exceeded once in 100,000.
  EXPECT_LT(NormalisedError(*target, camera, camera_from_target, detection, stained), 2.1);
}

INSTANTIATE_TEST_SUITE_P(, StainedTagTest,
                         testing::Combine(testing::Values(1, 3), testing::Range(uint64_t{0}, uint64_t{3})),
                         [](const auto& test) {
                           const std::string side = std::to_string(std::get<0>(test.param));
                           return side + "x" + side + "_view_" + std::to_string(std::get<1>(test.param));
                         });

// The order is that of Kalibr: counter-clockwise from the bottom left, with y up.
TEST(AprilTagGrid, CornersCountFromTheBottomLeft) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 1, 1, ", first_id: 7");
  const std::vector<TargetPoint>& points = target->points();
  ASSERT_EQ(points.size(), 4U);
  for (int corner = 0; corner < 4; ++corner) EXPECT_EQ(points[static_cast<size_t>(corner)].id, 4 * 7 + corner);
  EXPECT_EQ(points[0].in_target, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(points[1].in_target, Eigen::Vector3d(0.03, 0, 0));
  EXPECT_EQ(points[2].in_target, Eigen::Vector3d(0.03, 0.03, 0));
  EXPECT_EQ(points[3].in_target, Eigen::Vector3d(0, 0.03, 0));
}

TEST(AprilTagGrid, FindsNothingInNoise) {
  const std::unique_ptr<Target> target = MakeGrid("tag16h5", 5, 6, "");
  cv::Mat noise(480, 640, CV_8UC1);
  cv::RNG random(5);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, noise, cv::Size(), 2);
  cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
  const Detection detection = target->Detect(noise);
  EXPECT_THAT(detection.ids, IsEmpty());
  EXPECT_THAT(detection.reason, HasSubstr("no tag"));
  EXPECT_THAT(target->Detect(cv::Mat(5, 5, CV_8UC1, cv::Scalar(0))).reason, Not(IsEmpty()));
}

TEST(AprilTagGrid, ReadsKalibrsTargetFile) {
  const std::unique_ptr<Target> target =
      MakeTarget("{target_type: aprilgrid, tagRows: 2, tagCols: 3, tagSize: 0.08, tagSpacing: 0.25}");
  ASSERT_EQ(target->type(), "apriltag_grid");
  ASSERT_EQ(target->points().size(), 24U);
  // Corner 2 (top right) of tag 4 (second row, second column): (0.1 + 0.08, 0.1 + 0.08).
  const TargetPoint& point = target->points()[18];
  EXPECT_EQ(point.id, 18);
  EXPECT_NEAR(point.in_target.x(), 0.18, 1e-12);
  EXPECT_NEAR(point.in_target.y(), 0.18, 1e-12);
}

// The image shows two copies of a target: no id is returned twice, and all points belong to one of the copies.
TEST(AprilTagGrid, IgnoresASecondTargetWithTheSameTags) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 2, 2, "");
  Rng rng(14);
  const Rigid3d camera_from_target = RandomView(target->Draw(), 0.6, 0.3, 0.2, rng);
  const cv::Mat view = RenderView(target->Draw(), ImageCamera(), camera_from_target);
  cv::Mat both;
  cv::hconcat(view, view, both);
  const Detection detection = target->Detect(both);
  EXPECT_EQ(detection.ids.size(), 16U);
  EXPECT_EQ(std::set<int>(detection.ids.begin(), detection.ids.end()).size(), 16U);
  const bool is_left = detection.pixels[0].x() < view.cols;
  for (const Eigen::Vector2d& pixel : detection.pixels) EXPECT_EQ(pixel.x() < view.cols, is_left);
  EXPECT_THAT(detection.reason, HasSubstr("tags left out"));
}

// A few large tags belong to a copy that is cut off by the corner of the image; the whole target is farther away.
TEST(AprilTagGridNightly, FindsTheTargetWithMoreVisibleTags) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 6, 6, ", corner_squares: false");
  const Camera camera{"pinhole", 4000, 3000, {4000, 4000, 1999.5, 1499.5}};
  const Drawing& drawing = target->Draw();
  const auto pose = [&](double distance_m, double right_px, double down_px) {
    const Eigen::Quaterniond rotation = ExpRotation({0.1, 0.05, 0.1}) * ExpRotation(kPi * Eigen::Vector3d::UnitX());
    const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
    return Rigid3d(rotation, Eigen::Vector3d(right_px / 4000 * distance_m, down_px / 4000 * distance_m, distance_m) -
                                 rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
  };
  RenderOptions options;
  options.noise_sigma_grey = 2;
  // The tags are 150 px and 30 px large.
  const double tag_m = (target->points()[1].in_target - target->points()[0].in_target).norm();
  const Rigid3d far = pose(tag_m * 4000 / 30, 500, 300);
  cv::Mat image = RenderView(drawing, camera, far, options);
  const cv::Rect corner(0, 0, 440, 440);
  RenderView(drawing, camera, pose(tag_m * 4000 / 150, -2180, -1680), options)(corner).copyTo(image(corner));
  const Detection detection = target->Detect(image);
  EXPECT_EQ(TagsOf(detection).size(), 36U) << detection.reason;
  EXPECT_LT(ErrorsOf(*target, camera, far, detection).max_px, 0.3);
}

TEST(AprilTagGrid, SearchesImagesOfAnyShape) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 2, 2, "");
  cv::RNG random(6);
  for (const cv::Size& size : {cv::Size(16, 20000), cv::Size(20000, 17), cv::Size(320, 16)}) {
    cv::Mat noise(size, CV_8UC1);
    random.fill(noise, cv::RNG::UNIFORM, 0, 256);
    EXPECT_THAT(target->Detect(noise).ids, IsEmpty());
  }
}

TEST(AprilTagGrid, ThreadsShareOneTarget) {
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 3, 3, "");
  Rng rng(15);
  const cv::Mat view = RenderView(target->Draw(), ImageCamera(), RandomView(target->Draw(), 0.8, 0.5, 0.5, rng));
  const Detection alone = target->Detect(view);
  ASSERT_EQ(alone.ids.size(), 36U);
  std::vector<Detection> detections(4);
  std::vector<std::thread> threads;
  for (Detection& detection : detections) threads.emplace_back([&] { detection = target->Detect(view); });
  for (std::thread& thread : threads) thread.join();
  for (const Detection& detection : detections) {
    EXPECT_EQ(detection.ids, alone.ids);
    EXPECT_EQ(detection.pixels, alone.pixels);
  }
}

TEST(AprilTagGrid, RejectsInvalidSettings) {
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tag25h9", 6, 6, ""); }), HasSubstr("tag25h9 has 35 tags"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tag36h11", 2, 2, ", first_id: 584"); }), HasSubstr("last id is 587"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tagStandard41h12", 1, 1, ", border_bits: 2"); }), HasSubstr("border_bits"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tagStandard41h12", 2, 2, ", tag_spacing: 0.3"); }),
              HasSubstr("tag_spacing of at least 1"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tagStandard41h12", 1, 1, ", corner_squares: true"); }),
              HasSubstr("must be false"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tag36h12", 1, 1, ""); }), HasSubstr("family"));
  EXPECT_THAT(InputErrorOf([] { MakeGrid("tag36h11", 1, 1, ", tag_spacing: 0"); }), HasSubstr("at least 0.01"));
}

cv::Point2d PositionOf(const Target& target, int id) {
  const Eigen::Vector3d& point_m = target.points()[static_cast<size_t>(id - target.points()[0].id)].in_target;
  return {point_m.x(), point_m.y()};
}

// Returns the indices of the four detected tags that are nearest to a detected tag on the target.
std::vector<size_t> NearestTags(const Target& target, const Detection& detection, size_t tag) {
  const cv::Point2d here_m = PositionOf(target, detection.ids[4 * tag]);
  std::vector<std::pair<double, size_t>> others;
  for (size_t other = 0; other < detection.ids.size() / 4; ++other) {
    if (other != tag) others.emplace_back(cv::norm(PositionOf(target, detection.ids[4 * other]) - here_m), other);
  }
  std::sort(others.begin(), others.end());
  std::vector<size_t> nearest;
  for (size_t k = 0; k < 4; ++k) nearest.push_back(others[k].second);
  return nearest;
}

// Returns the largest distance of a corner of a detected tag from the position that the four nearest tags predict,
// relative to the side of the tag.
double MisfitOf(const Target& target, const Detection& detection, size_t tag) {
  std::vector<cv::Point2d> board;
  std::vector<cv::Point2d> image;
  for (const size_t other : NearestTags(target, detection, tag)) {
    for (size_t i = 4 * other; i < 4 * other + 4; ++i) {
      board.push_back(PositionOf(target, detection.ids[i]));
      image.emplace_back(detection.pixels[i].x(), detection.pixels[i].y());
    }
  }
  const cv::Mat image_from_board = cv::findHomography(board, image);
  std::vector<cv::Point2d> corners;
  for (size_t i = 4 * tag; i < 4 * tag + 4; ++i) corners.push_back(PositionOf(target, detection.ids[i]));
  cv::perspectiveTransform(corners, corners, image_from_board);
  double worst = 0;
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d& found_px = detection.pixels[4 * tag + k];
    const double side_px = (detection.pixels[4 * tag + (k + 1) % 4] - found_px).norm();
    worst = std::max(worst, (Eigen::Vector2d(corners[k].x, corners[k].y) - found_px).norm() / side_px);
  }
  return worst;
}

// Returns the largest misfit of all detected tags, or 0 if there are fewer than five. A misread tag is off by a whole
// tag.
double WorstMisfit(const Target& target, const Detection& detection) {
  const size_t num_tags = detection.ids.size() / 4;
  if (num_tags < 5) return 0;
  double worst = 0;
  for (size_t tag = 0; tag < num_tags; ++tag) worst = std::max(worst, MisfitOf(target, detection, tag));
  return worst;
}

struct RecordedSheet {
  const char* image;
  int rows = 6;
  int columns = 6;
  int border_bits = 2;
};
void PrintTo(const RecordedSheet& sheet, std::ostream* stream) { *stream << sheet.image; }

const RecordedSheet kRecordedSheets[] = {{"rs_tumvi_1520525725372653511.png"},
                                         {"rs_EuRoC.png"},
                                         {"rs_TUM_VI.png"},
                                         {"rs_iphone.png", 6, 11},
                                         {"rs_r45.png"},
                                         {"rs_right.png"},
                                         {"rs_top.png"},
                                         {"rs_top_right.png"},
                                         {"rs_two_boards.png"},
                                         {"py_000.jpg"},
                                         {"py_001.jpg"},
                                         {"py_002.jpg"},
                                         {"py_003.jpg"},
                                         {"py_004.jpg"},
                                         {"py_t36h11_2bit_margin.jpg"},
                                         {"py_t36h11_1bit_margin.png", 11, 14, 1}};

std::filesystem::path SheetsFolder() { return DataDir() / "detect_kalibr_aprilgrid"; }

// Returns the tags listed for each recorded image, which another detector (cv::aruco with markerBorderBits) reads.
std::map<std::string, std::set<int>> ListedTags() {
  std::ifstream file(SheetsFolder() / "dataset.json");
  const nlohmann::json data = nlohmann::json::parse(file);
  std::map<std::string, std::set<int>> tags;
  for (const nlohmann::json& image : data.at("images")) tags[image.at("image")] = image.at("ids").get<std::set<int>>();
  return tags;
}

class RecordedSheetTest : public testing::TestWithParam<RecordedSheet> {};

// The images are from phones and fisheye lenses, and one is a scanned sheet: every listed tag is found, and no tag
// where it cannot be.
TEST_P(RecordedSheetTest, EveryListedTagIsRead) {
  HEBA_SKIP_WITHOUT(SheetsFolder());
  const RecordedSheet& sheet = GetParam();
  const int num_tags = sheet.rows * sheet.columns;
  cv::Mat grey = ReadGreyImage(SheetsFolder() / "images" / sheet.image);
  // The scan has 87 megapixels; its tags are large enough at a quarter of its size.
  if (grey.total() > 20e6) cv::resize(grey, grey, {}, 0.25, 0.25, cv::INTER_AREA);
  const std::set<int> listed = ListedTags().at(sheet.image);
  // rs_two_boards.png shows a second target, whose ids continue those of the first.
  for (int first_id = 0; first_id <= *listed.rbegin(); first_id += num_tags) {
    const std::unique_ptr<Target> target =
        MakeGrid("tag36h11", sheet.rows, sheet.columns,
                 ", border_bits: " + std::to_string(sheet.border_bits) + ", first_id: " + std::to_string(first_id));
    const Detection detection = target->Detect(grey);
    const std::set<int> found = TagsOf(detection);
    EXPECT_EQ(detection.ids.size(), 4 * found.size()) << "a point twice";
    for (const int id : listed) {
      if (id >= first_id && id < first_id + num_tags) {
        EXPECT_EQ(found.count(id), 1U) << "tag " << id;
      }
    }
    EXPECT_LT(WorstMisfit(*target, detection), 0.25) << "first id " << first_id;
  }
}

INSTANTIATE_TEST_SUITE_P(, RecordedSheetTest, testing::ValuesIn(kRecordedSheets),
                         [](const auto& test) { return std::filesystem::path(test.param.image).stem().string(); });

TEST(AprilTagGrid, EveryRecordedSheetIsTested) {
  HEBA_SKIP_WITHOUT(SheetsFolder());
  std::set<std::string> tested;
  for (const RecordedSheet& sheet : kRecordedSheets) tested.insert(sheet.image);
  EXPECT_EQ(tested.size(), 16U);
  std::set<std::string> listed;
  for (const auto& [image, tags] : ListedTags()) listed.insert(image);
  EXPECT_EQ(listed, tested);
}

using TagCornersPx = std::array<Eigen::Vector2d, 4>;

// Returns the corners of all tags that a file of libapriltag's own test lists; all of them are copies of tag 0.
std::vector<TagCornersPx> ListedCorners(const std::filesystem::path& path) {
  std::vector<TagCornersPx> tags;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    // "0, (277.9 327.4), (250.3 329.7), (251.6 357.3), (279.4 354.6)"
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    std::istringstream numbers(line);
    int id = -1;
    if (!(numbers >> id)) continue;
    EXPECT_EQ(id, 0);
    TagCornersPx corners_px;
    for (Eigen::Vector2d& corner_px : corners_px) {
      EXPECT_TRUE(numbers >> corner_px.x() >> corner_px.y()) << line;
      // libapriltag has the centre of the first pixel at (0.5, 0.5).
      corner_px -= Eigen::Vector2d(0.5, 0.5);
    }
    tags.push_back(corners_px);
  }
  return tags;
}

// Returns the largest distance of a listed corner from the detected one.
double FarthestPx(const TagCornersPx& listed_px, const std::vector<Eigen::Vector2d>& found_px) {
  double farthest_px = 0;
  for (size_t k = 0; k < listed_px.size(); ++k) {
    farthest_px = std::max(farthest_px, (found_px[k] - listed_px[k]).norm());
  }
  return farthest_px;
}

// The parameter is the name of an image of libapriltag's own test.
class LibapriltagReferenceTest : public testing::TestWithParam<std::string> {};

// The images show many copies of tag 0: one of them is found, at a position listed by libapriltag's own test. That
// test runs without refinement of the edges, so the tolerance is one pixel.
TEST_P(LibapriltagReferenceTest, AgreesWithTheFoundTag) {
  const std::filesystem::path folder = DataDir() / "detect_apriltag_reference" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const std::unique_ptr<Target> target = MakeGrid("tag36h11", 1, 1, ", corner_squares: false");
  const std::unique_ptr<Target> absent = MakeGrid("tag36h11", 4, 4, ", corner_squares: false, first_id: 1");
  const cv::Mat grey = ReadGreyImage(folder / (GetParam() + ".jpg"));
  EXPECT_THAT(absent->Detect(grey).ids, IsEmpty());
  const Detection detection = target->Detect(grey);
  ASSERT_EQ(detection.ids.size(), 4U);
  double nearest_px = INFINITY;
  for (const TagCornersPx& listed_px : ListedCorners(folder / (GetParam() + ".txt"))) {
    nearest_px = std::min(nearest_px, FarthestPx(listed_px, detection.pixels));
  }
  EXPECT_LT(nearest_px, 1);
}

INSTANTIATE_TEST_SUITE_P(, LibapriltagReferenceTest,
                         testing::Values("33369213973_9d9bb4cc96_c", "34085369442_304b6bafd9_c",
                                         "34139872896_defdb2f8d9_c"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace heba
