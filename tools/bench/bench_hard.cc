// Counts which targets are found in rendered images of the kinds that detectors fail at, and how many points are wrong,
// beside OpenCV's and AprilTag's detectors.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gflags/gflags.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "tools/bench/other_detectors.h"
#include "tools/bench/target_of.h"

DEFINE_int32(images, 40, "images of each kind");
DEFINE_int32(seed, 1, "seed of all random numbers");
DEFINE_string(only, "", "only the kinds whose names contain this");

namespace heba {
namespace {

using Spoil = std::function<cv::Mat(const cv::Mat& grey, Rng& random)>;

cv::Mat WithSpots(const cv::Mat& grey, Rng& random) {
  // The dots of an infrared projector: one on 150 px, with a radius of 1 to 2 px.
  cv::Mat spotted = grey.clone();
  const auto num_spots = static_cast<int>(grey.total() / 150);
  for (int i = 0; i < num_spots; ++i) {
    const cv::Point at(random.Index(grey.cols), random.Index(grey.rows));
    const double level = std::min(255.0, grey.at<uchar>(at) + random.Uniform(60, 140));
    cv::circle(spotted, at, random.Uniform(0, 1) < 0.5 ? 1 : 2, level, cv::FILLED, cv::LINE_AA);
  }
  return spotted;
}

cv::Mat Scaled(const cv::Mat& grey, double scale, double offset) {
  cv::Mat changed;
  grey.convertTo(changed, CV_8U, scale, offset);
  return changed;
}

cv::Mat WithNoise(const cv::Mat& grey, double sigma, Rng& random) {
  cv::Mat noisy = grey.clone();
  for (auto at = noisy.begin<uchar>(); at != noisy.end<uchar>(); ++at) {
    *at = cv::saturate_cast<uchar>(*at + sigma * random.Normal());
  }
  return noisy;
}

cv::Mat Dark(const cv::Mat& grey, Rng& random) { return WithNoise(Scaled(grey, 0.12, 2), 3, random); }

cv::Mat Smeared(const cv::Mat& grey, Rng& random) {
  constexpr int kLength = 7;
  cv::Mat kernel = cv::Mat::zeros(kLength, kLength, CV_32F);
  const double angle = random.Uniform(0, kPi);
  const cv::Point2d half(0.5 * (kLength - 1) * std::cos(angle), 0.5 * (kLength - 1) * std::sin(angle));
  const cv::Point2d middle(0.5 * (kLength - 1), 0.5 * (kLength - 1));
  cv::line(kernel, middle - half, middle + half, 1.0, 1, cv::LINE_AA);
  cv::Mat smeared;
  cv::filter2D(grey, smeared, CV_8U, kernel / cv::sum(kernel)[0]);
  return smeared;
}

// Adds the reflection of a lamp: an elliptic spot that saturates in its middle.
cv::Mat WithGlare(const cv::Mat& grey, Rng& random) {
  cv::Mat light = cv::Mat::zeros(grey.size(), CV_32F);
  const cv::Point at{static_cast<int>(grey.cols * random.Uniform(0.35, 0.65)),
                     static_cast<int>(grey.rows * random.Uniform(0.35, 0.65))};
  cv::ellipse(light, at, {grey.cols / 12, grey.cols / 24}, random.Uniform(0, 180), 0, 360, 200.0, cv::FILLED);
  cv::GaussianBlur(light, light, {}, 0.015 * grey.cols);
  cv::Mat lit;
  grey.convertTo(lit, CV_32F);
  lit += light;
  lit.convertTo(lit, CV_8U);
  return lit;
}

// Takes 70 % of the light from one side of a line through the middle.
cv::Mat Shadowed(const cv::Mat& grey, Rng& random) {
  const double angle = random.Uniform(0, 2 * kPi);
  cv::Mat shadowed = grey.clone();
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double side = (x - 0.5 * grey.cols) * std::cos(angle) + (y - 0.5 * grey.rows) * std::sin(angle);
      const double light = 1 - 0.35 * (1 + std::tanh(side / 4));
      shadowed.at<uchar>(y, x) = cv::saturate_cast<uchar>(light * grey.at<uchar>(y, x));
    }
  }
  return shadowed;
}

cv::Mat Compressed(const cv::Mat& grey, Rng& /*random*/) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, 30});
  return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
}

struct Kind {
  const char* name;
  int rows;  // Inner corners of the chessboard.
  int columns;
  int width_px;
  int height_px;
  Spoil spoil;
};

const std::vector<Kind>& Kinds() {
  static const std::vector<Kind> kinds = {
      {"plain", 6, 9, 1280, 960, nullptr},
      {"infrared dots", 6, 9, 1280, 960, &WithSpots},
      {"low light", 6, 9, 1280, 960, &Dark},
      {"motion blur of 7 px", 6, 9, 1280, 960, &Smeared},
      {"glare", 6, 9, 1280, 960, &WithGlare},
      {"shadow over half", 6, 9, 1280, 960, &Shadowed},
      {"JPEG of quality 30", 6, 9, 1280, 960, &Compressed},
      {"JPEG of quality 30, 0.3 MP", 6, 9, 640, 480, &Compressed},
      {"3 x 3 corners", 3, 3, 1280, 960, nullptr},
      {"40 x 30 corners, 5 MP", 30, 40, 2560, 1920, nullptr},
      {"24 MP", 6, 9, 5656, 4242, nullptr},
  };
  return kinds;
}

// The points that a detector finds, of those in the image, and those that are wrong.
struct Counts {
  int whole = 0;  // Images in which all points are found.
  int found = 0;
  int wrong = 0;
  int num_images = 0;
  int num_points = 0;
  double sum_px2 = 0;  // The sum over the right points of their squared distances from the truth.
};

constexpr double kWrongPx = 3;

// Adds the points of a target with ids.
void Add(const Target& target, const Camera& camera, const Rigid3d& camera_from_target, const Detection& detection,
         double scale_px, Counts* counts) {
  int num_right = 0;
  for (size_t i = 0; i < detection.ids.size(); ++i) {
    double least_px = std::numeric_limits<double>::infinity();
    for (const Rigid3d& symmetry : target.Symmetries()) {
      const auto point = std::find_if(target.points().begin(), target.points().end(),
                                      [&](const TargetPoint& entry) { return entry.id == detection.ids[i]; });
      if (point == target.points().end()) continue;
      const Eigen::Vector2d off_px = detection.pixels[i] - *PixelOf(*point, camera, camera_from_target * symmetry);
      least_px = std::min(least_px, off_px.norm());
    }
    if (least_px >= kWrongPx * scale_px) continue;
    ++num_right;
    counts->sum_px2 += least_px * least_px;
  }
  const auto num_points = static_cast<int>(target.points().size());
  counts->found += num_right;
  counts->wrong += static_cast<int>(detection.ids.size()) - num_right;
  counts->whole += num_right == num_points ? 1 : 0;
  counts->num_points += num_points;
  ++counts->num_images;
}

// Returns corners without ids as a detection: each has the id of the nearest point.
Detection WithIds(const Target& target, const Camera& camera, const Rigid3d& camera_from_target,
                  const Corners& corners) {
  Detection detection;
  for (const cv::Point2f& corner : corners) {
    const Eigen::Vector2d pixel(corner.x, corner.y);
    int nearest = -1;
    double least = 1e9;
    for (const TargetPoint& point : target.points()) {
      const double distance = (pixel - *PixelOf(point, camera, camera_from_target)).norm();
      if (distance < least) {
        least = distance;
        nearest = point.id;
      }
    }
    detection.ids.push_back(nearest);
    detection.pixels.push_back(pixel);
  }
  return detection;
}

struct Method {
  std::string name;
  std::function<Detection(const Target&, const Camera&, const Rigid3d&, const cv::Mat&)> find;
};

void Compare(const Kind& kind, const std::string& what, const Target& target, const std::vector<Method>& methods) {
  const Camera camera{"brown5",
                      kind.width_px,
                      kind.height_px,
                      {0.9 * kind.width_px, 0.9 * kind.width_px, 0.5 * kind.width_px, 0.5 * kind.height_px, -0.1, 0.03,
                       1e-3, -5e-4, 0}};
  const Drawing& drawing = target.Draw();
  const double size_m = (drawing.max_m - drawing.min_m).norm();
  constexpr int kMostLargeImages = 4;
  const bool is_large = kind.width_px > 4000;
  std::vector<Counts> counts(methods.size());
  for (int i = 0; i < (is_large ? std::min(kMostLargeImages, FLAGS_images) : FLAGS_images); ++i) {
    Rng random(static_cast<uint64_t>(FLAGS_seed), static_cast<uint64_t>(i));
    const Eigen::Quaterniond front =
        drawing.y_up ? ExpRotation(kPi * Eigen::Vector3d::UnitX()) : Eigen::Quaterniond::Identity();
    const double towards = random.Uniform(-kPi, kPi);
    const Eigen::Quaterniond rotation =
        ExpRotation(random.Uniform(0.1, 0.7) * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
        ExpRotation(random.Uniform(-kPi, kPi) * Eigen::Vector3d::UnitZ()) * front;
    const Eigen::Vector2d middle = 0.5 * (drawing.min_m + drawing.max_m);
    const Eigen::Vector3d place(0, 0, random.Uniform(1.25, 1.9) * size_m);
    const Rigid3d pose(rotation, place - rotation * Eigen::Vector3d(middle.x(), middle.y(), 0));
    RenderOptions options;
    options.noise_sigma_grey = 1.5;
    options.clutter = true;
    options.light_gradient = 0.3;
    options.seed = static_cast<uint64_t>(FLAGS_seed * 1000 + i);
    cv::Mat grey = RenderView(drawing, camera, pose, options);
    if (kind.spoil) grey = kind.spoil(grey, random);
    for (size_t m = 0; m < methods.size(); ++m) {
      Add(target, camera, pose, methods[m].find(target, camera, pose, grey), std::max(1.0, kind.width_px / 1280.0),
          &counts[m]);
    }
  }
  for (size_t m = 0; m < methods.size(); ++m) {
    const Counts& c = counts[m];
    std::printf("%-28s %-11s %-20s %5.1f %% of the points, %3d of %3d images whole, %d wrong, %.3f px\n", kind.name,
                what.c_str(), methods[m].name.c_str(), 100.0 * c.found / c.num_points, c.whole, c.num_images, c.wrong,
                std::sqrt(c.sum_px2 / std::max(1, 2 * c.found)));
  }
  std::fflush(stdout);
}

Method Own() {
  return {"heba",
          [](const Target& target, const Camera&, const Rigid3d&, const cv::Mat& grey) { return target.Detect(grey); }};
}

void Run() {
  for (const Kind& kind : Kinds()) {
    if (std::string(kind.name).find(FLAGS_only) == std::string::npos) continue;
    const BoardSize size{kind.rows, kind.columns};
    const auto board = TargetOf("type: chessboard, rows: " + std::to_string(kind.rows) +
                                ", columns: " + std::to_string(kind.columns) + ", square: 20 mm");
    const auto by_corners = [&](auto find) {
      return [=](const Target& target, const Camera& camera, const Rigid3d& pose, const cv::Mat& grey) {
        return WithIds(target, camera, pose, find(grey));
      };
    };
    Compare(kind, "chessboard", *board,
            {Own(),
             {"OpenCV SB", by_corners([=](const cv::Mat& grey) { return BySectors(grey, size, 0); })},
             {"OpenCV classic", by_corners([=](const cv::Mat& grey) { return BySubPix(grey, size, 5); })}});
    if (kind.rows != 6) continue;
    const auto tags =
        TargetOf("type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 30 mm, corner_squares: false");
    const auto by_tags = [](auto find) {
      return [=](const Target&, const Camera&, const Rigid3d&, const cv::Mat& grey) { return find(grey); };
    };
    Compare(kind, "tags", *tags,
            {Own(),
             {"libapriltag", by_tags([](const cv::Mat& grey) { return FindWithAprilTag(grey, 1); })},
             {"OpenCV aruco", by_tags(&FindWithAruco)}});
  }
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  heba::Run();
  return 0;
}
