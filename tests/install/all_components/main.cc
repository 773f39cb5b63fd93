// Uses every component: renders images of a target, runs a whole calibration on them and exports the result.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/io/export_files.h"
#include "heba/robot/ur_kinematics.h"
#include "heba/run.h"

namespace {

// Draws the target of squares as the camera sees it, oversampled.
cv::Mat Render(const heba::Camera& camera, const heba::Rigid3d& target_from_camera) {
  constexpr int kOversampling = 4;
  cv::Mat image(camera.height_px * kOversampling, camera.width_px * kOversampling, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector2d pixel((x + 0.5) / kOversampling - 0.5, (y + 0.5) / kOversampling - 0.5);
      const Eigen::Vector3d ray = target_from_camera.rotation * *heba::UnprojectPixel(camera, pixel);
      const Eigen::Vector3d& eye = target_from_camera.translation;
      const Eigen::Vector3d point = eye - eye.z() / ray.z() * ray;
      const int column = static_cast<int>(std::floor(point.x() / 0.03)) + 1;
      const int row = static_cast<int>(std::floor(point.y() / 0.03)) + 1;
      const bool is_square = row >= 0 && row < 7 && column >= 0 && column < 9 && (row + column) % 2 == 0;
      image.at<uchar>(y, x) = is_square ? 30 : 220;
    }
  }
  cv::resize(image, image, cv::Size(camera.width_px, camera.height_px), 0, 0, cv::INTER_AREA);
  return image;
}

}  // namespace

int main(int /*argc*/, char** argv) {
  using heba::ExpRotation;
  using heba::Rigid3d;
  const heba::HandEye truth{Rigid3d(ExpRotation({0.1, -0.2, 0.3}), {0.05, -0.02, 0.1}),
                            Rigid3d(ExpRotation({0.2, 0.1, -0.3}), {0.6, 0.1, 0.02})};
  const heba::Camera camera{"pinhole", 640, 480, {700, 700, 320, 240}};
  heba::Dataset dataset = heba::DatasetOf(
      heba::Setup::kEyeInHand, heba::ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}"), camera);
  for (int i = 0; i < 10; ++i) {
    const Rigid3d camera_from_target(ExpRotation({0.4 * std::sin(i), 0.4 * std::cos(1.7 * i), 0.3 * std::sin(2.3 * i)}),
                                     {-0.1, -0.07, 0.45 + 0.05 * std::cos(i)});
    const std::filesystem::path image = std::filesystem::path(argv[1]) / (std::to_string(i) + ".png");
    cv::imwrite(image.string(), Render(camera, Inverse(camera_from_target)));
    const Rigid3d gripper_from_base =
        truth.camera_mount_from_camera * camera_from_target * Inverse(truth.target_mount_from_target);
    dataset.captures.push_back({image.filename().string(), {Inverse(gripper_from_base)}, {image}});
  }
  const heba::Outcome<heba::RunOutput> run = heba::Run(dataset, heba::RunOptions());
  if (!run) {
    std::printf("%s\n", run.reason().c_str());
    return 1;
  }
  const heba::Estimate& refined = *heba::FindRefined(run->result);
  const double error_m = heba::DistanceM(refined.hand_eye.camera_mount_from_camera, truth.camera_mount_from_camera);
  std::printf("%zu captures, %.3f mm from the truth\n", run->result.images.size(), 1000 * error_m);
  const heba::ExportRequests requests = heba::MakeExportRequests(run->result);
  int num_formats = 0;
  for (const heba::ExportFormat& format : heba::ExportFormats()) {
    for (const heba::ExportedFile& file : ExportFiles(format, requests)) num_formats += file.text.empty() ? 0 : 1;
  }
  std::printf("%d formats, %zu arms\n", num_formats, heba::UrRobots().size());
  return error_m < 1e-3 && num_formats > 5 && !heba::UrRobots().empty() ? 0 : 1;
}
