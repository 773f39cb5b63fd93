// Measures the detection of targets in rendered images in memory: CPU milliseconds per image, number of points and
// their accuracy, compared with libapriltag and OpenCV's aruco as their users call them; then the duration of
// searches that end without the target (--table misses). With `--target KEYS IMAGE...` it searches files instead.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gflags/gflags.h>
#include <opencv2/core.hpp>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "heba/target.h"
#include "targets/images/image.h"
#include "targets/render/clutter.h"
#include "targets/render/rendering.h"
#include "tools/bench/other_detectors.h"
#include "tools/bench/target_of.h"

DEFINE_int32(images, 5, "images of each row; the figures are their medians");
DEFINE_string(only, "", "only the rows whose names contain this");
DEFINE_string(table, "", "one table: times or misses");
DEFINE_string(target, "", "keys of a target to search for in the files that follow, one line for each file");

namespace heba {
namespace {

double CpuMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Measured {
  double cpu_ms = 0;
  double num_found = 0;
  double rms_px = 0;  // RMS error of a coordinate.
};

Measured MiddleOf(std::vector<Measured> all) {
  const auto middle = [&](double Measured::*field) {
    std::sort(all.begin(), all.end(), [&](const Measured& a, const Measured& b) { return a.*field < b.*field; });
    return all[all.size() / 2].*field;
  };
  return {middle(&Measured::cpu_ms), middle(&Measured::num_found), middle(&Measured::rms_px)};
}

// A detector that returns the ids and positions of the target's points.
using Finder = std::function<Detection(const cv::Mat& grey)>;

Measured Measure(const Target& target, const Camera& camera, const Rigid3d& camera_from_target, const cv::Mat& grey,
                 const Finder& find) {
  Measured measured;
  const double start_ms = CpuMs();
  const Detection detection = find(grey);
  measured.cpu_ms = CpuMs() - start_ms;
  double sum = 0;
  for (size_t i = 0; i < detection.ids.size(); ++i) {
    const auto point = std::find_if(target.points().begin(), target.points().end(),
                                    [&](const TargetPoint& entry) { return entry.id == detection.ids[i]; });
    if (point == target.points().end()) continue;
    const Eigen::Vector2d off_px = detection.pixels[i] - *PixelOf(*point, camera, camera_from_target);
    constexpr double kWildPx = 2;
    if (off_px.norm() > kWildPx) continue;
    sum += off_px.squaredNorm();
    ++measured.num_found;
  }
  measured.rms_px = std::sqrt(sum / std::max(1.0, 2 * measured.num_found));
  return measured;
}

struct Row {
  std::string what;
  std::string keys;
  int width_px;
  int height_px;
  double distance_m;  // The focal length in pixels equals the image width.
  double blur_px;
};

// Returns a camera whose focal length is the width of its images.
Camera PinholeOf(int width_px, int height_px) {
  const double focal_px = width_px;
  return {"pinhole", width_px, height_px, {focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1)}};
}

// Returns the light and the noise of an ordinary image.
RenderOptions OrdinaryLight() {
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.light_gradient = 0.3;
  return options;
}

void Run(const Row& row) {
  if (row.what.find(FLAGS_only) == std::string::npos) return;
  const std::unique_ptr<Target> target = TargetOf(row.keys);
  const bool has_tags = target->type() == "apriltag_grid";
  const Drawing& drawing = target->Draw();
  const Camera camera = PinholeOf(row.width_px, row.height_px);
  std::vector<std::pair<std::string, Finder>> finders = {
      {"heba", [&](const cv::Mat& grey) { return target->Detect(grey); }}};
  if (has_tags) {
    finders.emplace_back("libapriltag, decimate 1", [](const cv::Mat& grey) { return FindWithAprilTag(grey, 1); });
    finders.emplace_back("libapriltag, decimate 4", [](const cv::Mat& grey) { return FindWithAprilTag(grey, 4); });
    finders.emplace_back("OpenCV aruco, subpix", &FindWithAruco);
  }
  std::vector<std::vector<Measured>> all(finders.size());
  for (int picture = 0; picture < FLAGS_images; ++picture) {
    Rng rng(7, static_cast<uint64_t>(picture));
    const Eigen::Quaterniond front = drawing.y_up ? ExpRotation({kPi, 0, 0}) : Eigen::Quaterniond::Identity();
    const Eigen::Quaterniond rotation = ExpRotation({rng.Uniform(-0.4, 0.4), rng.Uniform(-0.4, 0.4), 0}) *
                                        ExpRotation({0, 0, rng.Uniform(-0.3, 0.3)}) * front;
    const Eigen::Vector2d middle = 0.5 * (drawing.min_m + drawing.max_m);
    const Rigid3d camera_from_target(
        rotation, Eigen::Vector3d{rng.Uniform(-0.02, 0.02), rng.Uniform(-0.02, 0.02), 1} * row.distance_m -
                      rotation * Eigen::Vector3d(middle.x(), middle.y(), 0));
    RenderOptions options = OrdinaryLight();
    options.clutter = true;
    options.blur_sigma_px = row.blur_px;
    options.seed = static_cast<uint64_t>(picture);
    const cv::Mat grey = RenderView(drawing, camera, camera_from_target, options);
    for (size_t i = 0; i < finders.size(); ++i) {
      all[i].push_back(Measure(*target, camera, camera_from_target, grey, finders[i].second));
    }
  }
  for (size_t i = 0; i < finders.size(); ++i) {
    const Measured middle = MiddleOf(all[i]);
    std::printf("| %-34s | %-24s | %8.1f | %4.0f of %4zu | %7.4f |\n", row.what.c_str(), finders[i].first.c_str(),
                middle.cpu_ms, middle.num_found, target->points().size(), middle.rms_px);
    std::fflush(stdout);
  }
}

// Returns a pose in which the target spans up to two thirds of the image in height and width, its middle is offset
// from the image centre by `aside` (in units of the image size), and it is rotated by `turn_rad` in its plane.
Rigid3d PlacedPose(const Drawing& drawing, const Camera& camera, const Eigen::Vector2d& aside, double turn_rad) {
  constexpr double kShareOfHeight = 0.66;
  const Eigen::Vector2d size_m = drawing.max_m - drawing.min_m;
  const double focal_px = camera.params[0];
  const double distance_m = std::max(size_m.y() * focal_px / (kShareOfHeight * camera.height_px),
                                     size_m.x() * focal_px / (kShareOfHeight * camera.width_px));
  const Eigen::Quaterniond front = drawing.y_up ? ExpRotation({kPi, 0, 0}) : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond rotation = ExpRotation({0.2, -0.15, 0}) * ExpRotation({0, 0, turn_rad}) * front;
  const Eigen::Vector2d middle = 0.5 * (drawing.min_m + drawing.max_m);
  const Eigen::Vector3d place(aside.x() * camera.width_px / focal_px, aside.y() * camera.height_px / focal_px, 1);
  return {rotation, distance_m * place - rotation * Eigen::Vector3d(middle.x(), middle.y(), 0)};
}

// Returns the offset to the right at which a third of the target's points are outside the image.
double AsideOfCut(const Target& target, const Camera& camera, double turn_rad) {
  for (double aside = 0; aside < 1; aside += 0.005) {
    const Rigid3d camera_from_target = PlacedPose(target.Draw(), camera, {aside, 0}, turn_rad);
    size_t num_outside = 0;
    for (const TargetPoint& point : target.points()) {
      const std::optional<Eigen::Vector2d> pixel = PixelOf(point, camera, camera_from_target);
      num_outside += !pixel || pixel->x() > camera.width_px - 1 ? 1 : 0;
    }
    if (3 * num_outside >= target.points().size()) return aside;
  }
  return 1;
}

// The keys of one target of each kind.
struct Kind {
  const char* name;
  const char* keys;
};
constexpr Kind kKinds[] = {
    {"coded_board", "type: coded_board, rows: 4, columns: 5, spacing: 35 mm, dot_diameter: 10 mm"},
    {"apriltag_grid, squares", "type: apriltag_grid, family: tag36h11, rows: 6, columns: 6, tag_size: 24 mm"},
    {"apriltag_grid, plain",
     "type: apriltag_grid, family: tag36h11, rows: 6, columns: 6, tag_size: 24 mm, corner_squares: false"},
    {"chessboard", "type: chessboard, rows: 7, columns: 10, square: 20 mm"},
    {"chessboard, small", "type: chessboard, rows: 4, columns: 3, square: 50 mm"},
    {"charuco", "type: charuco, rows: 7, columns: 9, square: 20 mm, marker: 15 mm, dictionary: DICT_5X5_100"},
    {"circle_grid", "type: circle_grid, rows: 7, columns: 9, spacing: 20 mm"},
    {"circle_grid, asymmetric", "type: circle_grid, rows: 11, columns: 4, spacing: 15 mm, asymmetric: true"},
};

// The duration of a search in some images, and the smallest and the largest number of points that it found.
struct SearchFigures {
  double middle_ms = 0;
  double longest_ms = 0;
  size_t least_found = 0;
  size_t most_found = 0;
};

// Searches FLAGS_images images for a target; `render` returns that of a seed.
SearchFigures MeasureSearch(const Target& target, const std::function<cv::Mat(uint64_t seed)>& render) {
  std::vector<double> cpu_ms;
  size_t most_found = 0;
  size_t least_found = target.points().size();
  for (int picture = 0; picture < FLAGS_images; ++picture) {
    const cv::Mat grey = render(static_cast<uint64_t>(picture));
    const double start_ms = CpuMs();
    const size_t num_found = target.Detect(grey).ids.size();
    cpu_ms.push_back(CpuMs() - start_ms);
    most_found = std::max(most_found, num_found);
    least_found = std::min(least_found, num_found);
  }
  std::sort(cpu_ms.begin(), cpu_ms.end());
  return {cpu_ms[cpu_ms.size() / 2], cpu_ms.back(), least_found, most_found};
}

// Searches for one kind of target in images that show it, that do not, and that show two thirds of it.
void RunMisses(const Kind& kind, int width_px, int height_px) {
  const std::string name = std::string(kind.name) + ", " + std::to_string(width_px) + " x " + std::to_string(height_px);
  if (name.find(FLAGS_only) == std::string::npos) return;
  const std::unique_ptr<Target> target = TargetOf(kind.keys);
  const Camera camera = PinholeOf(width_px, height_px);
  const RenderOptions plain = OrdinaryLight();
  RenderOptions noisy = plain;
  noisy.noise_sigma_grey = 12;
  RenderOptions cluttered = plain;
  cluttered.clutter = true;
  // A camera with the target behind it sees only the background.
  const Rigid3d behind(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -10));
  struct Scene {
    std::string what;
    std::function<cv::Mat(uint64_t seed)> render;
  };
  const auto render = [&](const Target& drawn, const Rigid3d& pose, RenderOptions options, uint64_t seed) {
    options.seed = seed;
    return RenderView(drawn.Draw(), camera, pose, options);
  };
  const auto turn_of = [](uint64_t seed) { return 0.3 * static_cast<double>(seed) - 0.4; };
  std::vector<Scene> scenes = {
      {"shown",
       [&](uint64_t seed) {
         return render(*target, PlacedPose(target->Draw(), camera, {0, 0}, turn_of(seed)), cluttered, seed);
       }},
      {"blank wall", [&](uint64_t seed) { return render(*target, behind, plain, seed); }},
      {"noise", [&](uint64_t seed) { return render(*target, behind, noisy, seed); }},
      {"clutter", [&](uint64_t seed) { return render(*target, behind, cluttered, seed); }},
      {"cut off, upright",
       [&](uint64_t seed) {
         const double aside = AsideOfCut(*target, camera, 0);
         return render(*target, PlacedPose(target->Draw(), camera, {aside, 0}, 0), cluttered, seed);
       }},
      {"cut off, rotated",
       [&](uint64_t seed) {
         const double turn_rad = 0.6 + 0.3 * static_cast<double>(seed);
         const double aside = AsideOfCut(*target, camera, turn_rad);
         return render(*target, PlacedPose(target->Draw(), camera, {aside, 0}, turn_rad), cluttered, seed);
       }},
  };
  for (const Kind& other : kKinds) {
    if (target->type() == TargetOf(other.keys)->type()) continue;
    scenes.push_back(
        {std::string("instead ") + other.name, [&](uint64_t seed) {
           const std::unique_ptr<Target> drawn = TargetOf(other.keys);
           return render(*drawn, PlacedPose(drawn->Draw(), camera, {0, 0}, turn_of(seed)), cluttered, seed);
         }});
  }
  double shown_ms = 0;
  for (const Scene& scene : scenes) {
    const SearchFigures figures = MeasureSearch(*target, scene.render);
    if (scene.what == "shown") shown_ms = figures.middle_ms;
    std::printf("| %-38s | %-31s | %8.0f | %8.0f | %6.2f | %3zu to %3zu of %3zu |\n", name.c_str(), scene.what.c_str(),
                figures.middle_ms, figures.longest_ms, figures.middle_ms / shown_ms, figures.least_found,
                figures.most_found, target->points().size());
    std::fflush(stdout);
  }
}

void RunAllMisses() {
  std::printf("| target | image | CPU ms, median | maximum | ratio to shown | points |\n|---|---|---|---|---|---|\n");
  for (const Kind& kind : kKinds) {
    RunMisses(kind, 1632, 1224);
    RunMisses(kind, 2592, 1944);
  }
}

void RunFiles(const std::vector<std::string>& files) {
  const std::unique_ptr<Target> target = TargetOf(FLAGS_target);
  std::printf("| file | megapixels | CPU ms | points |\n|---|---|---|---|\n");
  for (const std::string& file : files) {
    const cv::Mat grey = ReadGreyImage(file);
    cv::theRNG() = cv::RNG(1);  // DetectCapture sets the same seed.
    const double start_ms = CpuMs();
    const Detection detection = target->Detect(grey);
    std::printf("| %s | %.1f | %8.0f | %4zu of %4zu | %s\n", file.c_str(), 1e-6 * static_cast<double>(grey.total()),
                CpuMs() - start_ms, detection.ids.size(), target->points().size(), detection.reason.c_str());
    std::fflush(stdout);
  }
}

void RunAll() {
  const std::string plain =
      "type: apriltag_grid, family: tag36h11, rows: 6, columns: 6, tag_size: 24 mm, tag_spacing: 0.3, corner_squares: "
      "false";
  const std::string kalibr =
      "type: apriltag_grid, family: tag36h11, rows: 6, columns: 6, tag_size: 24 mm, tag_spacing: 0.3";
  const std::string coded = "type: coded_board, rows: 4, columns: 5, spacing: 35 mm, dot_diameter: 10 mm";
  std::printf("| image | program | CPU ms | points | rms px |\n|---|---|---|---|---|\n");
  constexpr double kBlurPx = 0.7;
  constexpr double kSharpPx = 0.3;  // Under more blur tags of 12 px are not readable at all.
  struct Size {
    const char* name;
    int width_px;
    int height_px;
  };
  for (const Size& size : {Size{"1.3", 1280, 1024}, Size{"5", 2592, 1944}, Size{"12", 4000, 3000}}) {
    const std::string megapixels = std::string(size.name) + " megapixels, ";
    // The board spans two thirds of the image height; tags are 12 px wide.
    const double near_m = 0.18 * size.width_px / (0.66 * size.height_px);
    const double far_m = 0.024 * size.width_px / 12.0;
    Run({megapixels + "near tags", plain, size.width_px, size.height_px, near_m, kBlurPx});
    Run({megapixels + "near tags, squares", kalibr, size.width_px, size.height_px, near_m, kBlurPx});
    Run({megapixels + "far tags", plain, size.width_px, size.height_px, far_m, kSharpPx});
    Run({megapixels + "coded dots", coded, size.width_px, size.height_px, near_m, kBlurPx});
  }
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::SetUsageMessage("Measures the duration of target detection.");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  if (!FLAGS_target.empty()) {
    heba::RunFiles({argv + 1, argv + argc});
    return 0;
  }
  if (FLAGS_table.empty() || FLAGS_table == "times") heba::RunAll();
  if (FLAGS_table.empty() || FLAGS_table == "misses") heba::RunAllMisses();
  return 0;
}
