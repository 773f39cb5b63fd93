#include "tools/pages/report_data.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"

namespace heba {
namespace {

// Returns camera_from_target of a target in an image of the problem, with the corrections of the arms.
Rigid3d PoseWithCorrection(const RunOutput& run, size_t capture, size_t camera, size_t target) {
  const Solution& refined = *run.calibration.refined;
  const Problem& problem = run.calibration.problem;
  return CameraFromTarget(
      problem, run.result.solution.poses, camera, target,
      Corrected(WithErrors(problem.captures[capture], refined.effects), refined.captures[capture].corrections));
}

Points2 Joined(const Points2& first, const Points2& second) {
  Points2 points(2, first.cols() + second.cols());
  points << first, second;
  return points;
}

// Returns the image with the observed points of a target, divided into those that the estimate used and those that it
// left out, and with their residuals. It stays as it is if a point cannot be projected.
ReportedImage WithPoints(ReportedImage image, const Camera& camera, const Rigid3d& camera_from_target,
                         const Observations& observations, const std::function<bool(int id)>& is_used) {
  const std::optional<Points2> residuals = Residuals(camera, camera_from_target, observations);
  if (!residuals) return image;
  std::vector<Eigen::Index> used;
  std::vector<Eigen::Index> left_out;
  for (Eigen::Index p = 0; p < residuals->cols(); ++p) {
    (is_used(observations.ids[static_cast<size_t>(p)]) ? used : left_out).push_back(p);
  }
  image.pixels = Joined(image.pixels, observations.pixels(Eigen::all, used));
  image.residuals = Joined(image.residuals, (*residuals)(Eigen::all, used));
  image.left_out_pixels = Joined(image.left_out_pixels, observations.pixels(Eigen::all, left_out));
  image.left_out_residuals = Joined(image.left_out_residuals, (*residuals)(Eigen::all, left_out));
  return image;
}

// Returns the image with the points of a detection. The problem has those of images that are used, in the reading order
// that was chosen; what it does not have was left out.
ReportedImage WithDetection(ReportedImage image, const RunOutput& run, const TargetDetection& detection) {
  const Solution& solution = run.result.solution;
  const size_t i = detection.capture;
  const size_t c = detection.camera;
  const size_t t = detection.target;
  if (image.small_jpeg.empty()) image.small_jpeg = detection.detection.small_jpeg;
  const Rigid3d camera_from_target = PoseWithCorrection(run, i, c, t);
  const auto add = [&](const Observations& observations, const std::function<bool(int)>& is_used) {
    if (observations.size() == 0) return;
    image = WithPoints(std::move(image), solution.cameras[c], camera_from_target,
                       ApplyShape(observations, solution.shapes[t]), is_used);
  };
  std::vector<int> known;
  const std::vector<ProblemImage>& images = run.calibration.problem.captures[i].images;
  for (size_t k = 0; k < images.size(); ++k) {
    if (images[k].camera != c || images[k].target != t) continue;
    const std::vector<int>& rejected = run.calibration.refined->captures[i].rejected_ids[k];
    known = images[k].observations.ids;
    add(images[k].observations, [&](int id) { return std::count(rejected.begin(), rejected.end(), id) == 0; });
  }
  Detection others;
  for (size_t p = 0; p < detection.detection.detection.ids.size(); ++p) {
    const int id = detection.detection.detection.ids[p];
    if (std::count(known.begin(), known.end(), id) > 0) continue;
    others.ids.push_back(id);
    others.pixels.push_back(detection.detection.detection.pixels[p]);
  }
  if (!others.ids.empty()) add(ObservationsOf(*run.dataset.targets[t], others), [](int) { return false; });
  return image;
}

// Returns the title of the `number`-th image of a camera.
std::string TitleOf(const ImageResult& image, size_t number) {
  if (image.camera.empty()) return std::to_string(number) + ": " + image.image;
  std::vector<std::string> targets;
  for (const TargetInImage& target : image.targets) targets.push_back(target.target);
  return "camera " + image.camera + ", image " + std::to_string(number) + ": " + image.image +
         (targets.empty() ? "" : (targets.size() == 1 ? ", target " : ", targets ") + Join(targets, ", "));
}

// Returns the images of each camera.
std::vector<CameraResiduals> ResidualsOf(const RunOutput& run) {
  const RunResult& result = run.result;
  std::vector<CameraResiduals> all;
  // The image of each capture and camera.
  std::map<std::pair<std::string, std::string>, std::pair<size_t, size_t>> place_of;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const std::string& name = result.rig.cameras[c].name;
    all.push_back({result.solution.cameras[c], result.solution.pixel_sigmas_px[c], std::nullopt, {}});
    std::vector<ReportedImage>& images = all.back().images;
    for (size_t e = 0; e < result.images.size(); ++e) {
      if (result.images[e].camera != name) continue;
      place_of.try_emplace({result.images[e].capture, name}, c, images.size());
      ReportedImage& image = images.emplace_back();
      image.entry = e;
      image.title = TitleOf(result.images[e], images.size());
    }
  }
  for (const TargetDetection& detection : run.detections) {
    const auto place =
        place_of.find({run.dataset.captures[detection.capture].name, result.rig.cameras[detection.camera].name});
    if (place == place_of.end()) continue;
    ReportedImage& image = all[place->second.first].images[place->second.second];
    image = WithDetection(std::move(image), run, detection);
  }
  for (CameraResiduals& camera : all) {
    SquaredErrors sum;
    for (ReportedImage& image : camera.images) {
      const SquaredErrors errors{image.residuals.squaredNorm(), static_cast<int>(image.residuals.cols())};
      image.rms_px = errors.RmsPx();
      sum.Add(errors);
    }
    camera.rms_px = sum.RmsPx();
  }
  return all;
}

}  // namespace

ReportData ReportDataOf(const RunOutput& run) {
  ReportData data;
  data.result = run.result;
  if (!run.calibration.refined) {
    // The errors of the arm are part of one estimate only.
    if (const Estimate* const estimate = FindFinal(run.result)) data.result = WithEstimate(run.result, *estimate);
    return data;
  }
  for (const std::shared_ptr<const Target>& target : run.dataset.targets) {
    data.target_points.push_back(AllPoints(*target).points_in_target);
  }
  if (run.dataset.truth) data.true_cameras = run.dataset.truth->cameras;
  data.residuals = ResidualsOf(run);
  for (size_t i = 0; i < data.result.captures.size(); ++i) {
    data.result.captures[i].corrections = run.calibration.refined->captures[i].corrections;
    data.has_corrections = data.has_corrections || !data.result.captures[i].corrections.empty();
  }
  return data;
}

}  // namespace heba
