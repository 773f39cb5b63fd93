// Measures the detection of targets in rendered images: precision and bias of points against the true positions,
// correctness of the stated covariances, recall by size and tilt, and false ids. It prints tables; the same flags
// give the same figures.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gflags/gflags.h>
#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

#include "heba/base/factorisation.h"
#include "heba/base/parallel.h"
#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/camera/camera.h"
#include "heba/detection.h"
#include "heba/target.h"
#include "targets/dots/ellipse_refinement.h"
#include "targets/dots/ring_code.h"
#include "targets/render/clutter.h"
#include "targets/render/rendering.h"
#include "tools/bench/target_of.h"

DEFINE_int32(views, 300, "views for each row of the precision table");
DEFINE_int32(images, 40, "images for each size and tilt of the recall table");
DEFINE_int32(cluttered, 1000, "cluttered images with and without a board for the count of false ids");
DEFINE_int32(jobs, 0, "threads; 0 for one per processor");
DEFINE_int32(seed, 1, "seed of all random numbers");
DEFINE_double(light, 0.3, "uneven light of the precision table, as a share of the brightest");
DEFINE_string(only, "", "one part: precision, recall or false");
DEFINE_string(row, "", "only the rows of the precision and recall tables whose names contain this");
DEFINE_string(crop, "", "writes a magnified image (.png) of a fitted dot with its outline and centre, and exits");

namespace heba {
namespace {

int NumThreads() { return FLAGS_jobs > 0 ? FLAGS_jobs : NumProcessors(); }

// Returns a pose with the middle of the drawing at depth `distance_m` in direction `aside` (x/z and y/z in the camera
// frame), tilted about a random axis parallel to the image plane, with a random roll.
Rigid3d RandomPose(const Drawing& drawing, double distance_m, double tilt_rad, const Eigen::Vector2d& aside, Rng& rng) {
  const double direction = rng.Uniform(0, 2 * kPi);
  // A drawing with y up faces the camera after a rotation by 180 degrees about x.
  const Eigen::Quaterniond front = drawing.y_up ? ExpRotation({kPi, 0, 0}) : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond rotation =
      ExpRotation(tilt_rad * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)) *
      ExpRotation({0, 0, rng.Uniform(0, 2 * kPi)}) * front;
  const Eigen::Vector2d middle = 0.5 * (drawing.min_m + drawing.max_m);
  const Eigen::Vector3d place(aside.x() * distance_m, aside.y() * distance_m, distance_m);
  return {rotation, place - rotation * Eigen::Vector3d(middle.x(), middle.y(), 0)};
}

// Errors of the detected points, and their stated covariances.
struct Errors {
  int num_expected = 0;
  int num_found = 0;
  int num_stated = 0;
  int num_wild = 0;  // More than half a pixel off; not in the sums.
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Vector2d sum_square = Eigen::Vector2d::Zero();
  double sum_normalised = 0;  // e' C^-1 e over all groups of points with a joint covariance.
  double num_normalised = 0;  // Number of their coordinates.

  void Add(const Errors& other) {
    num_expected += other.num_expected;
    num_found += other.num_found;
    num_stated += other.num_stated;
    num_wild += other.num_wild;
    sum += other.sum;
    sum_square += other.sum_square;
    sum_normalised += other.sum_normalised;
    num_normalised += other.num_normalised;
  }
  double RmsPx() const { return std::sqrt(sum_square.sum() / (2 * std::max(num_found - num_wild, 1))); }
  Eigen::Vector2d BiasPx() const { return sum / std::max(num_found - num_wild, 1); }
  double Chi() const { return num_normalised > 0 ? std::sqrt(sum_normalised / num_normalised) : 0; }
};

Errors Compare(const Target& target, const Detection& detection, const Camera& camera,
               const Rigid3d& camera_from_target) {
  Errors errors;
  errors.num_expected = static_cast<int>(target.points().size());
  std::vector<Eigen::Vector2d> offsets;
  for (size_t i = 0; i < detection.ids.size(); ++i) {
    const auto point = std::find_if(target.points().begin(), target.points().end(),
                                    [&](const TargetPoint& entry) { return entry.id == detection.ids[i]; });
    offsets.push_back(detection.pixels[i] - *PixelOf(*point, camera, camera_from_target));
    ++errors.num_found;
    if (offsets.back().norm() > 0.5) {
      ++errors.num_wild;
      continue;
    }
    errors.sum += offsets.back();
    errors.sum_square += offsets.back().cwiseAbs2();
  }
  size_t first = 0;
  for (const Eigen::MatrixXd& covariance : detection.covariances_px2) {
    const Eigen::Index size = covariance.rows();
    Eigen::VectorXd error(size);
    for (Eigen::Index i = 0; i < size; ++i) error[i] = offsets[first + static_cast<size_t>(i / 2)][i % 2];
    first += static_cast<size_t>(size / 2);
    if (error.cwiseAbs().maxCoeff() > 0.5) continue;
    errors.sum_normalised += MahalanobisSquare(error, covariance);
    errors.num_normalised += static_cast<double>(size);
  }
  return errors;
}

// Returns the symmetry of the target under which the detection fits the true pose best.
Rigid3d BestOrder(const Target& target, const Detection& detection, const Camera& camera,
                  const Rigid3d& camera_from_target) {
  Rigid3d best;
  double least = INFINITY;
  for (const Rigid3d& target_from_target : target.Symmetries()) {
    double sum = 0;
    for (size_t i = 0; i < detection.ids.size(); ++i) {
      const TargetPoint& point = target.points()[static_cast<size_t>(detection.ids[i])];
      sum += (detection.pixels[i] - *PixelOf(point, camera, camera_from_target * target_from_target)).norm();
    }
    if (sum < least) {
      least = sum;
      best = target_from_target;
    }
  }
  return best;
}

Errors Sum(int count, const std::function<Errors(int)>& work) {
  std::vector<Errors> parts(static_cast<size_t>(count));
  ParallelFor(count, NumThreads(), [&](int i) { parts[static_cast<size_t>(i)] = work(i); });
  Errors sum;
  for (const Errors& part : parts) sum.Add(part);
  return sum;
}

void PrintPrecision(const std::string& what, const Errors& errors) {
  const Eigen::Vector2d bias = errors.BiasPx();
  const double uncertainty = errors.RmsPx() / std::sqrt(std::max(errors.num_found, 1));
  std::printf("%-34s %7d %8.3f %5d %9.4f %9.4f %9.4f %8.4f", what.c_str(), errors.num_found,
              100.0 * errors.num_found / std::max(errors.num_expected, 1), errors.num_wild, errors.RmsPx(), bias.x(),
              bias.y(), uncertainty);
  if (errors.num_normalised > 0) {
    std::printf(" %6.3f\n", errors.Chi());
  } else {
    std::printf("   none\n");
  }
  std::fflush(stdout);
}

// A conventional method that measures the detected points again. Initial positions are rounded to whole pixels.
struct PlainMethod {
  const char* name;
  Detection (*measure)(const cv::Mat& grey, const Detection& found, double unit_px);
};

Detection SameIds(const Detection& found) {
  Detection plain;
  plain.ids = found.ids;
  return plain;
}

// Returns centroids weighted by darkness, over the dark area around the middle (below half of the contrast), dilated
// by two pixels.
Detection GreyCentroids(const cv::Mat& grey, const Detection& found, double radius_px) {
  Detection plain = SameIds(found);
  for (const Eigen::Vector2d& pixel : found.pixels) {
    const Eigen::Vector2i middle = pixel.array().round().cast<int>();
    const int reach_px = static_cast<int>(std::ceil(1.5 * radius_px)) + 3;
    const cv::Rect box = cv::Rect(middle.x() - reach_px, middle.y() - reach_px, 2 * reach_px + 1, 2 * reach_px + 1) &
                         cv::Rect(0, 0, grey.cols, grey.rows);
    const cv::Mat around = grey(box);
    double black = 0;
    double white = 0;
    cv::minMaxLoc(around, &black, &white);
    cv::Mat labels;
    cv::connectedComponents(around < 0.5 * (black + white), labels);
    cv::Mat dot = labels == labels.at<int>(middle.y() - box.y, middle.x() - box.x);
    cv::dilate(dot, dot, cv::Mat::ones(5, 5, CV_8U));
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int row = 0; row < around.rows; ++row) {
      for (int column = 0; column < around.cols; ++column) {
        if (dot.at<uchar>(row, column) == 0) continue;
        const double weight = white - around.at<uchar>(row, column);
        if (weight > 0.1 * (white - black)) sum += weight * Eigen::Vector3d(column + box.x, row + box.y, 1);
      }
    }
    plain.pixels.emplace_back(sum.head<2>() / sum.z());
  }
  return plain;
}

// Refines with cv::cornerSubPix in a window that nearly reaches the next edge, which is `free_px` away.
Detection SubPixCorners(const cv::Mat& grey, const Detection& found, double free_px) {
  Detection plain = SameIds(found);
  const int half_px = std::clamp(static_cast<int>(std::lround(0.7 * free_px)), 2, 11);
  std::vector<cv::Point2f> corners;
  for (const Eigen::Vector2d& pixel : found.pixels) {
    corners.emplace_back(static_cast<float>(std::round(pixel.x())), static_cast<float>(std::round(pixel.y())));
  }
  if (corners.empty()) return plain;
  cv::cornerSubPix(grey, corners, cv::Size(half_px, half_px), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-3));
  for (const cv::Point2f& corner : corners) plain.pixels.emplace_back(corner.x, corner.y);
  return plain;
}

Detection ChessboardCorners(const cv::Mat& grey, const Detection& found, double square_px) {
  return SubPixCorners(grey, found, 0.7 * square_px);  // 0.7 = cos(45 deg) is the foreshortening at the largest tilt.
}
// The corners of the markers, an eighth of a square away in both directions, are nearer than the next square.
Detection CharucoCorners(const cv::Mat& grey, const Detection& found, double square_px) {
  return SubPixCorners(grey, found, 0.125 * square_px);
}

// Returns libapriltag's own corners of the board's only tag, with the centre of the first pixel moved to (0, 0).
Detection LibapriltagCorners(const cv::Mat& grey, const Detection& /*found*/, double /*unit_px*/) {
  Detection plain;
  apriltag_family_t* const family = tag36h11_create();
  apriltag_detector_t* const detector = apriltag_detector_create();
  apriltag_detector_add_family_bits(detector, family, 1);
  detector->quad_decimate = 1;
  detector->refine_edges = true;
  image_u8_t image = {grey.cols, grey.rows, static_cast<int32_t>(grey.step[0]), grey.data};
  zarray_t* const tags = apriltag_detector_detect(detector, &image);
  for (int i = 0; i < zarray_size(tags); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(tags, i, &tag);
    if (tag->id != 0 || !plain.ids.empty()) continue;
    for (int corner = 0; corner < 4; ++corner) {
      plain.ids.push_back(corner);
      plain.pixels.emplace_back(tag->p[corner][0] - 0.5, tag->p[corner][1] - 0.5);
    }
  }
  apriltag_detections_destroy(tags);
  apriltag_detector_destroy(detector);
  tag36h11_destroy(family);
  return plain;
}

struct Look {
  double unit_px;  // Length of the target's unit in the middle of the image.
  double blur_px;
  double noise_grey;
};

// Returns the errors of heba and of the plain method at f = 2400 px with tilts up to 45 degrees and any roll.
std::array<Errors, 2> MeasurePrecision(const Target& target, double unit_m, const Look& look,
                                       const PlainMethod& plain) {
  const Drawing& drawing = target.Draw();
  constexpr double kFocalPx = 2400;
  const double distance_m = kFocalPx * unit_m / look.unit_px;
  const double extent_px = 1.1 * (drawing.max_m - drawing.min_m).norm() * look.unit_px / unit_m;
  const int size_px = static_cast<int>(extent_px) + 40;
  std::vector<std::array<Errors, 2>> parts(static_cast<size_t>(FLAGS_views));
  ParallelFor(FLAGS_views, NumThreads(), [&](int view) {
    Rng rng(static_cast<uint64_t>(FLAGS_seed), static_cast<uint64_t>(view));
    const double middle_px = 0.5 * (size_px - 1);
    const Camera camera{"pinhole", size_px, size_px, {kFocalPx, kFocalPx, middle_px, middle_px}};
    const Eigen::Vector2d aside{rng.Uniform(-0.5, 0.5) / kFocalPx, rng.Uniform(-0.5, 0.5) / kFocalPx};
    Rigid3d camera_from_target = RandomPose(drawing, distance_m, rng.Uniform(0, kPi / 4), aside, rng);
    RenderOptions options;
    options.blur_sigma_px = look.blur_px;
    options.noise_sigma_grey = look.noise_grey;
    options.black_grey = 30;
    options.white_grey = 200;
    options.light_gradient = FLAGS_light;
    options.seed = static_cast<uint64_t>(FLAGS_seed) * 1000003 + static_cast<uint64_t>(view);
    const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
    const Detection detection = target.Detect(grey);
    camera_from_target = camera_from_target * BestOrder(target, detection, camera, camera_from_target);
    parts[static_cast<size_t>(view)] = {
        Compare(target, detection, camera, camera_from_target),
        Compare(target, plain.measure(grey, detection, look.unit_px), camera, camera_from_target)};
  });
  std::array<Errors, 2> sums;
  for (const std::array<Errors, 2>& part : parts) {
    for (size_t k = 0; k < 2; ++k) sums[k].Add(part[k]);
  }
  return sums;
}

struct PrecisionRow {
  const char* what;
  const char* keys;
  double unit_m;
  PlainMethod plain;
  std::vector<Look> looks;
};

void ReportPrecision() {
  std::printf(
      "precision: f 2400 px, tilt 0 to 45 deg, contrast 170 grey, uneven light %.2f, %d views per row; below each row "
      "the plain library's\n",
      FLAGS_light, FLAGS_views);
  std::printf("rms: of a coordinate; chi: root of e' C^-1 e divided by its expectation, with joint covariances\n");
  std::printf("%-34s %7s %8s %5s %9s %9s %9s %8s %6s\n", "", "points", "recall %", ">.5px", "rms px", "bias x",
              "bias y", "+-", "chi");
  const PrecisionRow rows[] = {
      {"dot r",
       "type: coded_board, rows: 2, columns: 2, spacing: 40 mm, dot_diameter: 10 mm",
       0.005,
       {"grey centroid", &GreyCentroids},
       {{5, 0.7, 2}, {5, 1.2, 2}, {5, 1.2, 4}, {10, 0.7, 2}, {10, 1.2, 2}, {10, 1.2, 4}, {20, 0.7, 2}, {20, 1.2, 4}}},
      {"tag side",
       "type: apriltag_grid, family: tag36h11, rows: 1, columns: 1, tag_size: 40 mm, corner_squares: false",
       0.04,
       {"libapriltag", &LibapriltagCorners},
       {{30, 0.7, 2}, {30, 1.2, 4}, {60, 0.7, 2}, {60, 1.2, 4}, {120, 0.7, 2}, {120, 1.2, 4}}},
      {"chessboard square",
       "type: chessboard, rows: 4, columns: 5, square: 20 mm",
       0.02,
       {"cornerSubPix", &ChessboardCorners},
       {{15, 0.7, 2}, {15, 1.2, 4}, {30, 0.7, 2}, {30, 1.2, 4}}},
      {"charuco square",
       "type: charuco, rows: 4, columns: 5, square: 20 mm, marker: 15 mm, dictionary: DICT_4X4_50",
       0.02,
       {"cornerSubPix", &CharucoCorners},
       {{30, 0.7, 2}, {30, 1.2, 4}, {60, 0.7, 2}, {60, 1.2, 4}}},
  };
  for (const PrecisionRow& row : rows) {
    const std::unique_ptr<Target> target = TargetOf(row.keys);
    for (const Look& look : row.looks) {
      char what[80];
      std::snprintf(what, sizeof what, "%s %.0f px, blur %.1f, noise %.0f", row.what, look.unit_px, look.blur_px,
                    look.noise_grey);
      if (std::string(what).find(FLAGS_row) == std::string::npos) continue;
      const std::array<Errors, 2> errors = MeasurePrecision(*target, row.unit_m, look, row.plain);
      PrintPrecision(what, errors[0]);
      PrintPrecision(std::string("  ") + row.plain.name, errors[1]);
    }
  }
}

// Draws a board amid dots, rings and coded rings that do not belong to it, in front of the renderer's clutter.
Drawing AmidRoundMarks(const Target& board, int count, const std::vector<uint32_t>& avoided_codes, double margin_m,
                       Rng& rng) {
  Drawing drawing = board.Draw();
  const Eigen::AlignedBox2d kept(drawing.min_m, drawing.max_m);
  drawing.min_m.array() -= margin_m;
  drawing.max_m.array() += margin_m;
  const double radius_m = board.points()[0].radius_m;
  RoundMarksOptions marks;
  marks.count = count;
  marks.min_radius_m = 0.4 * radius_m;
  marks.max_radius_m = 2 * radius_m;
  marks.avoided_codes = avoided_codes;
  return WithRoundMarks(std::move(drawing), marks, kept, rng);
}

// Measures the recall of points whose rings are entirely in the image; ids at wrong positions are counted as wild.
Errors MeasureRecall(double diameter_px, double tilt_rad) {
  const bool large = diameter_px > 60;
  const std::unique_ptr<Target> board =
      TargetOf(large ? "type: coded_board, rows: 2, columns: 2, spacing: 32.5 mm, dot_diameter: 10 mm"
                     : "type: coded_board, rows: 4, columns: 5, spacing: 35 mm, dot_diameter: 10 mm");
  // Codes of the board itself are avoided: a code that appears twice would be a different experiment.
  std::vector<uint32_t> own = RingCodes(12, RingCodeOrder::kSeparation);
  own.resize(board->points().size());
  const double radius_m = 0.005;
  const Camera camera = large ? Camera{"pinhole", 2448, 2048, {2400, 2400, 1223.5, 1023.5}}
                              : Camera{"pinhole", 1280, 960, {1400, 1400, 639.5, 479.5}};
  const int num_images = large ? std::max(FLAGS_images / 2, 1) : FLAGS_images;
  return Sum(num_images, [&](int picture) {
    Rng rng(static_cast<uint64_t>(FLAGS_seed) + 100, static_cast<uint64_t>(picture));
    const Drawing drawing = AmidRoundMarks(*board, large ? 10 : 60, own, large ? 0.03 : 0.1, rng);
    const double distance_m = camera.params[0] * 2 * radius_m / diameter_px;
    const Eigen::Vector2d aside{rng.Uniform(-0.1, 0.1), rng.Uniform(-0.1, 0.1)};
    const Rigid3d camera_from_target = RandomPose(drawing, distance_m, tilt_rad, aside, rng);
    RenderOptions options;
    options.blur_sigma_px = 0.7;
    options.noise_sigma_grey = 2;
    options.light_gradient = 0.4;
    options.clutter = true;
    options.seed = static_cast<uint64_t>(FLAGS_seed) * 7919 + static_cast<uint64_t>(picture);
    const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
    const Detection detection = board->Detect(grey);
    Errors errors = Compare(*board, detection, camera, camera_from_target);
    errors.num_expected = 0;
    errors.num_found = 0;
    for (const TargetPoint& point : board->points()) {
      bool inside = true;
      for (int i = 0; i < 48 && inside; ++i) {
        const double angle = 2 * kPi * i / 48;
        const std::optional<Eigen::Vector2d> pixel = ProjectPoint(
            camera, camera_from_target *
                        (point.in_target + 3.2 * radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0)));
        inside =
            pixel && pixel->minCoeff() > 1 && pixel->x() < camera.width_px - 2 && pixel->y() < camera.height_px - 2;
      }
      if (!inside) continue;
      ++errors.num_expected;
      errors.num_found += std::count(detection.ids.begin(), detection.ids.end(), point.id) > 0 ? 1 : 0;
    }
    return errors;
  });
}

void ReportRecall() {
  std::printf("\nrecall, %%, among dots, rings and foreign coded rings; blur 0.7 px, noise 2, uneven light 0.4\n");
  std::printf("%-14s", "dot, tilt:");
  constexpr double kTiltsDeg[] = {0, 20, 40, 50, 60, 65};
  for (const double tilt_deg : kTiltsDeg) std::printf(" %14.0f deg", tilt_deg);
  std::printf("\n");
  Errors all;
  for (const double diameter_px : {8.0, 9.0, 10.0, 12.0, 16.0, 24.0, 40.0, 80.0, 150.0, 300.0}) {
    char what[16];
    std::snprintf(what, sizeof what, "%5.0f px", diameter_px);
    if (std::string(what).find(FLAGS_row) == std::string::npos) continue;
    std::printf("%s      ", what);
    for (const double tilt_deg : kTiltsDeg) {
      const Errors errors = MeasureRecall(diameter_px, tilt_deg * kPi / 180);
      std::printf("  %7.2f of %5d", 100.0 * errors.num_found / std::max(errors.num_expected, 1), errors.num_expected);
      std::fflush(stdout);
      if (tilt_deg <= 60) all.Add(errors);
    }
    std::printf("\n");
  }
  std::printf("all to 60 deg: %.3f %% of %d; %d wrong positions; chi %.3f\n",
              100.0 * all.num_found / std::max(all.num_expected, 1), all.num_expected, all.num_wild, all.Chi());
}

void ReportFalse() {
  const std::string keys = "type: coded_board, rows: 2, columns: 2, spacing: 40 mm, dot_diameter: 10 mm, first_id: ";
  const std::unique_ptr<Target> board = TargetOf(keys + "0");
  const std::unique_ptr<Target> other = TargetOf(keys + "4");
  const std::unique_ptr<Target> large =
      TargetOf("type: coded_board, rows: 12, columns: 12, spacing: 20 mm, dot_diameter: 5 mm, bits: 14");
  const Camera camera{"brown5", 1280, 960, {1400, 1400, 639.5, 479.5, -0.1, 0.05, 0, 0, 0}};
  std::vector<uint32_t> own = RingCodes(12, RingCodeOrder::kSeparation);
  own.resize(4);
  const std::vector<uint32_t> all_large = RingCodes(14, RingCodeOrder::kSeparation);
  struct Case {
    const char* what;
    const Target* drawn;
    const Target* sought;
    std::vector<uint32_t> avoided;
  };
  const Case cases[] = {{"2x2 board, absent (another one is shown)", other.get(), board.get(), own},
                        {"2x2 board, shown", board.get(), board.get(), {}},
                        {"12x12 board of 14 bits, absent", other.get(), large.get(), {}}};
  std::printf("\nfalse ids in %d images per row, full of dots, rings and foreign coded rings\n", FLAGS_cluttered);
  std::printf("%-40s %9s %9s %9s\n", "", "found", "true", "false");
  for (const Case& test : cases) {
    const Errors errors = Sum(FLAGS_cluttered, [&](int picture) {
      Rng rng(static_cast<uint64_t>(FLAGS_seed) + 200, static_cast<uint64_t>(picture));
      const Drawing drawing = AmidRoundMarks(*test.drawn, 120, test.avoided, 0.15, rng);
      const Eigen::Vector2d aside{rng.Uniform(-0.15, 0.15), rng.Uniform(-0.1, 0.1)};
      const double distance_m = rng.Uniform(0.3, 0.9);
      const Rigid3d camera_from_target = RandomPose(drawing, distance_m, rng.Uniform(0, 1.0), aside, rng);
      RenderOptions options;
      options.blur_sigma_px = rng.Uniform(0.4, 1.5);
      options.noise_sigma_grey = rng.Uniform(0, 5);
      options.light_gradient = 0.4;
      options.clutter = true;
      options.seed = static_cast<uint64_t>(FLAGS_seed) * 104729 + static_cast<uint64_t>(picture);
      const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
      const Detection detection = test.sought->Detect(grey);
      Errors counted;
      if (test.drawn == test.sought) {
        counted = Compare(*test.sought, detection, camera, camera_from_target);
      } else {
        counted.num_found = counted.num_wild = static_cast<int>(detection.ids.size());
      }
      // Images with false ids are saved for inspection.
      if (counted.num_wild > 0) {
        const std::string path = "false_" + std::to_string(picture) + ".png";
        std::printf("  %d false of %d, see %s\n", counted.num_wild, counted.num_found, path.c_str());
        for (size_t i = 0; i < detection.ids.size(); ++i) {
          std::printf("    id %d at %.2f, %.2f\n", detection.ids[i], detection.pixels[i].x(), detection.pixels[i].y());
        }
        cv::imwrite(path, grey);
      }
      return counted;
    });
    std::printf("%-40s %9d %9d %9d\n", test.what, errors.num_found, errors.num_found - errors.num_wild,
                errors.num_wild);
    std::fflush(stdout);
  }
}

// Writes a dot of 10 px radius, magnified 24 times, with its fitted outline and centre.
void WriteCrop(const std::string& path) {
  const std::unique_ptr<Target> board =
      TargetOf("type: coded_board, rows: 2, columns: 2, spacing: 40 mm, dot_diameter: 10 mm");
  const Drawing& drawing = board->Draw();
  Rng rng(static_cast<uint64_t>(FLAGS_seed));
  const Camera camera{"pinhole", 300, 300, {2400, 2400, 149.5, 149.5}};
  const Rigid3d camera_from_target = RandomPose(drawing, 1.2, 0.6, {0, 0}, rng);
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.light_gradient = FLAGS_light;
  const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
  const Detection detection = board->Detect(grey);
  if (detection.ids.empty()) return;
  const Ellipse start = Ellipse::FromAxes(detection.pixels[0], 10, 9, 0);
  RefineEllipseOptions refine_options;
  refine_options.next_outline_ratio = 2;
  const std::optional<RefinedEllipse> dot = RefineEllipse(grey, start, refine_options);
  constexpr int kScale = 24;
  constexpr int kReachPx = 16;
  const Eigen::Vector2i corner = detection.pixels[0].array().round().cast<int>() - kReachPx;
  const cv::Rect box =
      cv::Rect(corner.x(), corner.y(), 2 * kReachPx + 1, 2 * kReachPx + 1) & cv::Rect(0, 0, grey.cols, grey.rows);
  cv::Mat crop;
  cv::resize(grey(box), crop, cv::Size(), kScale, kScale, cv::INTER_NEAREST);
  cv::cvtColor(crop, crop, cv::COLOR_GRAY2BGR);
  const auto place = [&](const Eigen::Vector2d& pixel) {
    return cv::Point(static_cast<int>(std::lround((pixel.x() - box.x + 0.5) * kScale * 16)),
                     static_cast<int>(std::lround((pixel.y() - box.y + 0.5) * kScale * 16)));
  };
  const int shift = 4;  // Number of fractional bits of the coordinates.
  if (dot) {
    const Eigen::Matrix2d axes = EigenOfSymmetric(dot->ellipse.shape).InverseRoot();
    std::vector<cv::Point> outline;
    for (int i = 0; i < 360; ++i) {
      const double angle = 2 * kPi * i / 360;
      outline.push_back(place(dot->ellipse.centre_px + axes * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
    }
    cv::polylines(crop, outline, true, cv::Scalar(60, 60, 230), 1, cv::LINE_AA, shift);
  }
  const Eigen::Vector2d truth = *PixelOf(board->points()[0], camera, camera_from_target);
  const Eigen::Vector2d x(0.4, 0);
  const Eigen::Vector2d y(0, 0.4);
  const Eigen::Vector2d centre = detection.pixels[0];
  cv::line(crop, place(centre - x), place(centre + x), cv::Scalar(60, 200, 60), 1, cv::LINE_AA, shift);
  cv::line(crop, place(centre - y), place(centre + y), cv::Scalar(60, 200, 60), 1, cv::LINE_AA, shift);
  cv::imwrite(path, crop);
  std::printf("%s: centre at (%.4f, %.4f) px, truth (%.4f, %.4f)\n", path.c_str(), centre.x(), centre.y(), truth.x(),
              truth.y());
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::SetUsageMessage("Measures the accuracy and recall of target detection on rendered images.");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  if (!FLAGS_crop.empty()) {
    heba::WriteCrop(FLAGS_crop);
    return 0;
  }
  if (FLAGS_only.empty() || FLAGS_only == "precision") heba::ReportPrecision();
  if (FLAGS_only.empty() || FLAGS_only == "recall") heba::ReportRecall();
  if (FLAGS_only.empty() || FLAGS_only == "false") heba::ReportFalse();
  return 0;
}
