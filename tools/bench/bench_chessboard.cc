// Measures the chessboard corners of heba and of OpenCV's detectors: on rendered images, from point-sampled to
// blurred ones, against the truth; on folders of recorded images by the residuals of a camera calibration
// (cv::calibrateCamera) from the corners of each detector, over the images in which all detectors find the whole
// board. --sweep counts whole boards that heba refuses.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <unistd.h>

#include <gflags/gflags.h>
#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/parallel.h"
#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/camera/camera.h"
#include "heba/detection.h"
#include "heba/target.h"
#include "targets/images/image.h"
#include "targets/render/rendering.h"
#include "tools/bench/other_detectors.h"
#include "tools/bench/target_of.h"

DEFINE_int32(views, 60, "views for each row of the table");
DEFINE_int32(jobs, 0, "threads; 0 for one per processor");
DEFINE_int32(seed, 1, "seed of all random numbers");
DEFINE_string(row, "", "only the rows whose names contain this");
DEFINE_bool(others, true, "measures OpenCV's detectors too");
DEFINE_string(images, "", "a folder of recorded images to use instead of rendered ones");
DEFINE_int32(sweep, 0, "number of whole boards to render in any pose and light amid clutter; lists those refused");
DEFINE_string(board, "rows: 6, columns: 8", "inner corners of the board");

namespace heba {
namespace {

int NumThreads() { return FLAGS_jobs > 0 ? FLAGS_jobs : NumProcessors(); }

// Calls mrcal's detector, which is a separate program (Debian's package mrgingham) and finds square boards only.
Corners ByMrgingham(const cv::Mat& grey, const BoardSize& size) {
  static std::atomic<int> count{0};
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() /
      ("bench_chessboard_" + std::to_string(::getpid()) + "_" + std::to_string(count++) + ".png");
  cv::imwrite(file.string(), grey);
  const std::string command = "mrgingham --gridn " + std::to_string(size.rows) + " " + file.string();
  Corners corners;
  if (FILE* const output = popen(command.c_str(), "r")) {
    char line[4096];
    while (std::fgets(line, sizeof line, output) != nullptr) {
      float x = 0;
      float y = 0;
      if (line[0] != '#' && std::sscanf(line, "%*s %f %f", &x, &y) == 2) corners.emplace_back(x, y);
    }
    pclose(output);
  }
  std::filesystem::remove(file);
  return corners.size() == size.NumCorners() ? corners : Corners();
}

struct Method {
  const char* name;
  Corners (*find)(const cv::Mat& grey, const BoardSize& size);
};
constexpr Method kMethods[] = {
    {"SB", [](const cv::Mat& grey, const BoardSize& size) { return BySectors(grey, size, 0); }},
    {"SB accurate",
     [](const cv::Mat& grey, const BoardSize& size) {
       return BySectors(grey, size, cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
     }},
    {"subPix 3", [](const cv::Mat& grey, const BoardSize& size) { return BySubPix(grey, size, 3); }},
    {"subPix 5", [](const cv::Mat& grey, const BoardSize& size) { return BySubPix(grey, size, 5); }},
    {"mrgingham", &ByMrgingham},
};

// Returns the available methods that heba is compared with for a board of this size.
std::vector<Method> MethodsFor(const BoardSize& size) {
  std::vector<Method> methods;
  if (!FLAGS_others) return methods;
  for (const Method& method : kMethods) {
    const bool is_mrgingham = method.find == &ByMrgingham;
    if (is_mrgingham && (size.rows != size.columns || std::system("command -v mrgingham >/dev/null") != 0)) continue;
    methods.push_back(method);
  }
  return methods;
}

// Returns heba's corners by increasing id, or none if the board is incomplete.
Corners CornersOf(const Detection& detection, const BoardSize& size) {
  Corners corners;
  if (detection.ids.size() != size.NumCorners()) return corners;
  for (const Eigen::Vector2d& pixel : detection.pixels) {
    corners.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  }
  return corners;
}

struct Errors {
  int num_boards = 0;
  int num_found = 0;
  int num_wild = 0;  // Corners more than half a pixel off; not in the sums.
  int num = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Vector2d sum_square = Eigen::Vector2d::Zero();
  double sum_normalised = 0;  // Sum of e' C^-1 e.

  void Add(const Errors& other) {
    num_boards += other.num_boards;
    num_found += other.num_found;
    num_wild += other.num_wild;
    num += other.num;
    sum += other.sum;
    sum_square += other.sum_square;
    sum_normalised += other.sum_normalised;
  }
  Eigen::Vector2d RmsPx() const { return (sum_square / std::max(num, 1)).cwiseSqrt(); }
  Eigen::Vector2d BiasPx() const { return sum / std::max(num, 1); }
};

// Compares each corner with the nearest true one, so that the order does not matter.
Errors Compare(const Corners& corners, const std::vector<Eigen::Vector2d>& truth_px,
               const std::vector<Eigen::MatrixXd>& covariances_px2) {
  Errors errors;
  errors.num_boards = 1;
  errors.num_found = corners.empty() ? 0 : 1;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d pixel(corners[i].x, corners[i].y);
    const auto nearest =
        std::min_element(truth_px.begin(), truth_px.end(), [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
          return (a - pixel).squaredNorm() < (b - pixel).squaredNorm();
        });
    const Eigen::Vector2d error = pixel - *nearest;
    if (error.norm() > 0.5) {
      ++errors.num_wild;
      continue;
    }
    ++errors.num;
    errors.sum += error;
    errors.sum_square += error.cwiseAbs2();
    if (!covariances_px2.empty()) errors.sum_normalised += MahalanobisSquare(error, covariances_px2[i]);
  }
  return errors;
}

struct Row {
  bool is_point_sampled;
  double blur_px;
  double noise_grey;
  double square_px;
  double min_tilt_deg;
  double max_tilt_deg;

  std::string Name() const {
    char name[80];
    std::snprintf(name, sizeof name, "%s noise %.0f square %2.0f tilt %2.0f-%.0f",
                  is_point_sampled ? "sampled " : ("blur " + std::to_string(blur_px).substr(0, 3)).c_str(), noise_grey,
                  square_px, min_tilt_deg, max_tilt_deg);
    return name;
  }
};

std::vector<Row> Rows() {
  std::vector<Row> rows;
  const auto add = [&rows](double blur_px, double noise_grey, double square_px, double min_deg, double max_deg) {
    rows.push_back({blur_px < 0, std::max(blur_px, 0.0), noise_grey, square_px, min_deg, max_deg});
  };
  constexpr double kSampled = -1;
  for (const double blur_px : {kSampled, 0.0, 0.3, 0.5, 0.7, 1.2}) {
    for (const double noise_grey : {0.0, 2.0, 4.0}) add(blur_px, noise_grey, 25, 0, 45);
  }
  for (const double blur_px : {kSampled, 0.0, 0.5, 0.7}) {
    for (const double square_px : {8.0, 15.0, 40.0, 60.0}) add(blur_px, 2, square_px, 0, 45);
    add(blur_px, 2, 25, 45, 60);
  }
  return rows;
}

// Renders one view through a lens with moderate distortion, in which the board fills about a third of the image.
std::vector<Errors> MeasureView(const Target& target, const BoardSize& size, const std::vector<Method>& methods,
                                const Row& row, int view) {
  Rng rng(static_cast<uint64_t>(FLAGS_seed), static_cast<uint64_t>(view));
  const Drawing& drawing = target.Draw();
  const Eigen::Vector2d sheet_m = drawing.max_m - drawing.min_m;
  constexpr double kSquareM = 0.02;
  const int side_px = static_cast<int>(1.25 * sheet_m.norm() * row.square_px / kSquareM);
  const double focal_px = 1.5 * side_px;
  const double middle_px = 0.5 * (side_px - 1);
  const Camera camera{
      "brown5", side_px, side_px, {focal_px, focal_px, middle_px, middle_px, -0.2, 0.08, 1e-3, -5e-4, 0}};
  const double towards = rng.Uniform(0, 2 * kPi);
  const double tilt_rad = rng.Uniform(row.min_tilt_deg, row.max_tilt_deg) * kPi / 180;
  const Eigen::Quaterniond rotation = ExpRotation(tilt_rad * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
                                      ExpRotation({0, 0, rng.Uniform(0, 2 * kPi)});
  const double distance_m = focal_px * kSquareM / row.square_px;
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  const Eigen::Vector3d place_m{rng.Uniform(-0.03, 0.03) * distance_m, rng.Uniform(-0.03, 0.03) * distance_m,
                                distance_m};
  const Rigid3d camera_from_target(rotation, place_m - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
  RenderOptions options;
  options.is_point_sampled = row.is_point_sampled;
  options.blur_sigma_px = row.blur_px;
  options.noise_sigma_grey = row.noise_grey;
  options.black_grey = 30;
  options.white_grey = 200;
  options.light_gradient = 0.2;
  options.seed = static_cast<uint64_t>(FLAGS_seed) * 1000003 + static_cast<uint64_t>(view);
  const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
  std::vector<Eigen::Vector2d> truth_px;
  for (const TargetPoint& point : target.points()) truth_px.push_back(*PixelOf(point, camera, camera_from_target));
  const Detection detection = target.Detect(grey);
  std::vector<Errors> errors = {Compare(CornersOf(detection, size), truth_px, detection.covariances_px2)};
  for (const Method& method : methods) errors.push_back(Compare(method.find(grey, size), truth_px, {}));
  return errors;
}

void ReportRendered(const Target& target, const BoardSize& size) {
  std::printf(
      "contrast 170 grey, %d views per row; rms and bias in px along x and y; chi2: the mean of e' C^-1 e divided by "
      "2\n",
      FLAGS_views);
  std::printf("%-38s %-12s %6s %5s %8s %8s %8s %8s %6s\n", "", "", "found", ">.5px", "rms x", "rms y", "bias x",
              "bias y", "chi2");
  const std::vector<Method> methods = MethodsFor(size);
  for (const Row& row : Rows()) {
    if (row.Name().find(FLAGS_row) == std::string::npos) continue;
    std::vector<std::vector<Errors>> views(static_cast<size_t>(FLAGS_views));
    ParallelFor(FLAGS_views, NumThreads(),
                [&](int view) { views[static_cast<size_t>(view)] = MeasureView(target, size, methods, row, view); });
    for (size_t method = 0; method <= methods.size(); ++method) {
      Errors sum;
      for (const std::vector<Errors>& view : views) sum.Add(view[method]);
      const Eigen::Vector2d rms = sum.RmsPx();
      const Eigen::Vector2d bias = sum.BiasPx();
      std::printf("%-38s %-12s %6d %5d %8.4f %8.4f %8.4f %8.4f", method == 0 ? row.Name().c_str() : "",
                  method == 0 ? "heba" : methods[method - 1].name, sum.num_found, sum.num_wild, rms.x(), rms.y(),
                  bias.x(), bias.y());
      method == 0 ? std::printf(" %6.2f\n", sum.sum_normalised / (2 * std::max(sum.num, 1))) : std::printf("\n");
    }
    std::fflush(stdout);
  }
}

// Returns the corners in the order of heba's board, or none if they do not match.
Corners InOrderOf(const Corners& corners, const Corners& order) {
  Corners ordered;
  constexpr double kSamePx = 3;
  for (const cv::Point2f& wanted : order) {
    const auto nearest = std::min_element(
        corners.begin(), corners.end(),
        [&](const cv::Point2f& a, const cv::Point2f& b) { return cv::norm(a - wanted) < cv::norm(b - wanted); });
    if (nearest == corners.end() || cv::norm(*nearest - wanted) > kSamePx) return {};
    ordered.push_back(*nearest);
  }
  return ordered;
}

double CalibrationRmsPx(const std::vector<Corners>& images, const BoardSize& size, const cv::Size& image_size) {
  std::vector<cv::Point3f> board;
  for (int row = 0; row < size.rows; ++row) {
    for (int column = 0; column < size.columns; ++column) {
      board.emplace_back(static_cast<float>(column), static_cast<float>(row), 0.0F);
    }
  }
  cv::Mat matrix;
  cv::Mat distortion;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  return cv::calibrateCamera(std::vector<std::vector<cv::Point3f>>(images.size(), board), images, image_size, matrix,
                             distortion, rotations, translations, cv::CALIB_FIX_K3);
}

void ReportRecorded(const Target& target, const BoardSize& size) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(FLAGS_images)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  const int num_files = static_cast<int>(files.size());
  const std::vector<Method> methods = MethodsFor(size);
  const size_t num_methods = 1 + methods.size();
  std::vector<std::vector<Corners>> found(files.size());
  std::vector<cv::Size> sizes(files.size());
  ParallelFor(num_files, NumThreads(), [&](int i) {
    const auto index = static_cast<size_t>(i);
    const cv::Mat grey = ReadGreyImage(files[index]);
    sizes[index] = grey.size();
    found[index] = {CornersOf(target.Detect(grey), size)};
    for (const Method& method : methods) {
      found[index].push_back(InOrderOf(method.find(grey, size), found[index][0]));
    }
  });
  std::vector<int> num_found(num_methods, 0);
  std::vector<std::vector<Corners>> common(num_methods);
  for (const std::vector<Corners>& image : found) {
    const bool is_common = std::none_of(image.begin(), image.end(), [](const Corners& c) { return c.empty(); });
    for (size_t method = 0; method < num_methods; ++method) {
      if (!image[method].empty()) ++num_found[method];
      if (is_common) common[method].push_back(image[method]);
    }
  }
  std::printf("%s: %d images, in %zu of them all find the board\n", FLAGS_images.c_str(), num_files, common[0].size());
  if (common[0].empty()) return;
  for (size_t method = 0; method < num_methods; ++method) {
    std::printf("  %-12s found in %4d, rms of the calibration %.4f px\n",
                method == 0 ? "heba" : methods[method - 1].name, num_found[method],
                CalibrationRmsPx(common[method], size, sizes[0]));
  }
}

// Returns the smallest distance between opposite sides of a square, measured at its upper left corner. The corners
// are given row by row.
double LeastWidthPx(const std::vector<Eigen::Vector2d>& corners_px, int columns) {
  double least_px = std::numeric_limits<double>::infinity();
  const auto num_columns = static_cast<size_t>(columns);
  for (size_t i = 0; i + num_columns < corners_px.size(); ++i) {
    if ((i + 1) % num_columns == 0) continue;
    const Eigen::Vector2d right = corners_px[i + 1] - corners_px[i];
    const Eigen::Vector2d down = corners_px[i + num_columns] - corners_px[i];
    const double area = std::abs(right.x() * down.y() - right.y() * down.x());
    least_px = std::min(least_px, area / std::max(right.norm(), down.norm()));
  }
  return least_px;
}

// Returns whether a grid of points all over a drawing is within a box of the image.
bool IsWithin(const Eigen::AlignedBox2d& box_px, const Drawing& drawing, const Camera& camera,
              const Rigid3d& camera_from_target) {
  constexpr int kSteps = 12;
  for (int k = 0; k < kSteps * kSteps; ++k) {
    const int line = k / kSteps;
    const Eigen::Vector2d share((k % kSteps) / (kSteps - 1.0), line / (kSteps - 1.0));
    const Eigen::Vector2d at_m = drawing.min_m + share.cwiseProduct(drawing.max_m - drawing.min_m);
    const std::optional<Eigen::Vector2d> pixel =
        ProjectPoint(camera, camera_from_target * Eigen::Vector3d(at_m.x(), at_m.y(), 0));
    if (!pixel || !box_px.contains(*pixel)) return false;
  }
  return true;
}

// Draws a pose in which the whole board is in the image, tilted by up to 60 degrees, with squares of 10 to 80 px before
// the tilt.
Rigid3d DrawWholePose(const Drawing& drawing, const Camera& camera, double square_m, Rng& rng) {
  const Eigen::AlignedBox2d image(Eigen::Vector2d(2, 2), Eigen::Vector2d(camera.width_px - 3, camera.height_px - 3));
  while (true) {
    const double tilt_deg = rng.Uniform(0, 60);
    const double square_px = std::exp(rng.Uniform(std::log(10.0), std::log(80.0)));
    const double towards = rng.Uniform(0, 2 * kPi);
    const Eigen::Quaterniond rotation =
        ExpRotation(tilt_deg * kPi / 180 * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
        ExpRotation({0, 0, rng.Uniform(0, 2 * kPi)});
    const double distance_m = camera.params[0] * square_m / square_px;
    const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
    const Eigen::Vector3d place_m{rng.Uniform(-0.5, 0.5) * distance_m, rng.Uniform(-0.4, 0.4) * distance_m, distance_m};
    const Rigid3d camera_from_target(rotation, place_m - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
    if (IsWithin(image, drawing, camera, camera_from_target)) return camera_from_target;
  }
}

RenderOptions DrawRenderOptions(Rng& rng) {
  RenderOptions options;
  options.blur_sigma_px = rng.Uniform(0.2, 1.0);
  options.noise_sigma_grey = rng.Uniform(0, 4);
  options.light_gradient = rng.Uniform(0, 0.8);
  options.black_grey = rng.Uniform(5, 60);
  options.white_grey = options.black_grey + rng.Uniform(60, 190);
  options.clutter = rng.Uniform(0, 1) < 0.7;
  options.background_albedo = rng.Uniform(0, 1);
  return options;
}

// Returns the names of the other detectors that find the board, each with a comma after it.
std::string FoundByOthers(const cv::Mat& grey, const BoardSize& size) {
  std::string others;
  for (const Method& method : MethodsFor(size)) {
    if (!method.find(grey, size).empty()) others += std::string(" ") + method.name + ",";
  }
  return others.empty() ? " none," : others;
}

// Lists the boards that heba refuses or finds wrongly among rendered boards of any size that are entirely in the image
// (DrawWholePose).
void ReportRefusals() {
  constexpr double kSquareM = 0.02;
  std::vector<std::string> refusals(static_cast<size_t>(FLAGS_sweep));
  ParallelFor(FLAGS_sweep, NumThreads(), [&](int i) {
    Rng rng(static_cast<uint64_t>(FLAGS_seed) + 300, static_cast<uint64_t>(i));
    const int rows = 3 + rng.Index(7);
    const int columns = 3 + rng.Index(9);
    const std::unique_ptr<Target> target = TargetOf("type: chessboard, square: 20 mm, rows: " + std::to_string(rows) +
                                                    ", columns: " + std::to_string(columns));
    const Drawing& drawing = target->Draw();
    const Camera camera{"brown5", 1280, 960, {1100, 1100, 641, 478, rng.Uniform(-0.25, 0.05), 0.05, 5e-4, -5e-4, 0}};
    const Rigid3d camera_from_target = DrawWholePose(drawing, camera, kSquareM, rng);
    RenderOptions options = DrawRenderOptions(rng);
    options.seed = static_cast<uint64_t>(FLAGS_seed) * 15485863 + static_cast<uint64_t>(i);
    const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
    const Detection detection = target->Detect(grey);
    std::vector<Eigen::Vector2d> truth_px;
    for (const TargetPoint& point : target->points()) truth_px.push_back(*PixelOf(point, camera, camera_from_target));
    const Errors errors = Compare(CornersOf(detection, {rows, columns}), truth_px, detection.covariances_px2);
    if (errors.num_found == 1 && errors.num_wild == 0) return;
    char line[400];
    std::snprintf(line, sizeof line,
                  "%6d: %d x %d, squares at least %.1f px wide, found by%s blur %.1f, noise %.1f, grey %.0f to %.0f, "
                  "uneven light "
                  "%.1f, clutter %d: %zu corners, %d more than 0.5 px off: %s",
                  i, rows, columns, LeastWidthPx(truth_px, columns), FoundByOthers(grey, {rows, columns}).c_str(),
                  options.blur_sigma_px, options.noise_sigma_grey, options.black_grey, options.white_grey,
                  options.light_gradient, options.clutter ? 1 : 0, detection.ids.size(), errors.num_wild,
                  detection.reason.c_str());
    refusals[static_cast<size_t>(i)] = line;
    std::fprintf(stderr, "%s\n", line);
    if (FLAGS_row == "write") cv::imwrite("refused_" + std::to_string(i) + ".png", grey);
  });
  int num_refused = 0;
  for (const std::string& refusal : refusals) num_refused += refusal.empty() ? 0 : 1;
  std::printf("%d of %d whole boards refused or wrong\n", num_refused, FLAGS_sweep);
}

void Run() {
  if (FLAGS_sweep > 0) return ReportRefusals();
  const std::unique_ptr<Target> target = TargetOf("type: chessboard, square: 20 mm, " + FLAGS_board);
  // Points are ordered row by row.
  BoardSize size;
  for (const TargetPoint& point : target->points()) size.rows += point.in_target.x() == 0 ? 1 : 0;
  CHECK_GT(size.rows, 0);
  size.columns = static_cast<int>(target->points().size()) / size.rows;
  FLAGS_images.empty() ? ReportRendered(*target, size) : ReportRecorded(*target, size);
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::SetUsageMessage("Measures chessboard corners by heba and by OpenCV's detectors.");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  heba::Run();
  return 0;
}
