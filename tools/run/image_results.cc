#include "tools/run/image_results.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "heba/base/text.h"
#include "solvers/calibration/influence.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// Returns the errors of an image with the poses of the arms as given, corrected by the errors that captures share;
// nothing if a point has no image.
std::optional<SquaredErrors> ErrorsOf(const Problem& problem, const Solution& solution, const ProblemCapture& capture,
                                      const ProblemImage& image) {
  return ViewErrors(
      solution.cameras[image.camera],
      CameraFromTarget(problem, solution.poses, image.camera, image.target, WithErrors(capture, solution.effects)),
      ApplyShape(image.observations, solution.shapes[image.target]));
}

// The reasons why targets in an image, or points of them, were not used, in words.
class Reasons {
 public:
  void Add(const std::string& reason, const std::string& target) {
    const auto known = std::find_if(all_.begin(), all_.end(), [&](const auto& entry) { return entry.first == reason; });
    (known == all_.end() ? all_.emplace_back(reason, std::vector<std::string>()) : *known).second.push_back(target);
  }
  // Returns each reason after the targets that it concerns, unless there is one only.
  std::string Text(bool is_only_target) const {
    std::vector<std::string> texts;
    for (const auto& [reason, targets] : all_) {
      texts.push_back((is_only_target ? "" : "target " + Join(targets, ", target ") + ": ") + reason);
    }
    return Join(texts, "; ");
  }

 private:
  std::vector<std::pair<std::string, std::vector<std::string>>> all_;
};

// The places of images among those of the problem's captures.
using ImagePlace = std::pair<size_t, size_t>;

// Returns the reasons of a calibration for the images that it does not use.
std::map<ImagePlace, std::string> ReasonsOf(const Problem& seen, const Calibration& calibration) {
  std::map<ImagePlace, std::string> reason_of;
  for (const UnusedProblemImage& unused : calibration.unused) {
    for (size_t k = 0; k < seen.captures[unused.capture].images.size(); ++k) {
      if (!unused.image || *unused.image == k) reason_of[{unused.capture, k}] = unused.reason;
    }
  }
  return reason_of;
}

// The detection of each target in an image.
using DetectionOfTarget = std::map<size_t, const CaptureDetection*>;
// The detections in all images are found by capture and camera.
using DetectionOfImage = std::map<std::pair<size_t, size_t>, DetectionOfTarget>;

DetectionOfImage ByImage(const std::vector<TargetDetection>& detections) {
  DetectionOfImage of_image;
  for (const TargetDetection& detection : detections) {
    of_image[{detection.capture, detection.camera}][detection.target] = &detection.detection;
  }
  return of_image;
}

// Returns what is to be said about the points of a target in an image; empty if all are used.
std::string NoteOn(const TargetInImage& target, const CaptureDetection& detection, const std::string& reason) {
  if (!target.used) return reason.empty() ? "none of its points is where the estimate predicts it" : reason;
  std::vector<std::string> notes;
  if (!detection.detection.reason.empty()) notes.push_back(detection.detection.reason);
  if (target.num_rejected > 0) {
    notes.push_back(std::to_string(target.num_rejected) + (target.num_rejected == 1 ? " point is" : " points are") +
                    " rejected as inconsistent with the estimate from the others");
  }
  return Join(notes, "; ");
}

// Returns why an image shows no target: why its capture is not used, if no image of that shows any, or what the search
// for the only target says. The points of a capture that is not used may all have been rejected by a second search.
std::string WhyNotSeen(const CalibratedImages& calibrated, size_t capture, const DetectionOfTarget& searched) {
  if (calibrated.seen.captures[capture].images.empty()) {
    for (const UnusedProblemImage& unused : calibrated.calibration.unused) {
      if (unused.capture == capture && !unused.image) return unused.reason;
    }
  }
  const std::string why = searched.empty() ? "" : searched.begin()->second->detection.reason;
  return why.empty() ? "no target was detected" : why;
}

}  // namespace

PredictedImages PredictionsOf(const Calibration& calibration, const std::vector<TargetDetection>& detections) {
  const Solution& solution = *calibration.refined;
  std::vector<double> rms_px;
  for (const SquaredErrors& errors : ErrorsOfCameras(WithoutRejected(calibration.problem, solution), solution)) {
    rms_px.push_back(errors.RmsPx().value_or(0));
  }
  return PredictImages(calibration.problem, solution, detections, std::move(rms_px));
}

std::vector<SquaredErrors> ErrorsOfCameras(const Problem& used, const Solution& solution) {
  std::vector<SquaredErrors> sums(used.cameras.size());
  for (const ProblemCapture& capture : used.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() == 0) continue;
      const std::optional<SquaredErrors> errors = ErrorsOf(used, solution, capture, image);
      if (errors) sums[image.camera].Add(*errors);
    }
  }
  return sums;
}

std::vector<ImageResult> ImageResults(const ImageRun& run, const CalibratedImages& calibrated, const Problem& used,
                                      LossKind loss) {
  const Dataset& dataset = run.dataset;
  const Problem& seen = calibrated.seen;
  const Solution& solution = *calibrated.calibration.refined;
  const bool is_only_target = dataset.targets.size() == 1;
  const std::map<ImagePlace, std::string> reason_of = ReasonsOf(seen, calibrated.calibration);
  DetectionOfImage of_image = ByImage(calibrated.detections);
  std::vector<std::vector<std::optional<CaptureMove>>> moves;
  for (size_t c = 0; c < used.cameras.size(); ++c) {
    moves.push_back(MoveWithoutEachCapture(used, solution, c, LossOf(OfInliers(loss))));
  }
  std::vector<ImageResult> results;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const ProblemCapture& capture = seen.captures[i];
    for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
      if (dataset.captures[i].images[c].empty()) continue;
      const DetectionOfTarget& searched = of_image[{i, c}];
      ImageResult& result = results.emplace_back();
      result.capture = dataset.captures[i].name;
      result.camera = dataset.rig.cameras[c].name;
      result.image = ImageOf(dataset, i, c);
      Reasons reasons;
      for (size_t k = 0; k < capture.images.size(); ++k) {
        const ProblemImage& image = capture.images[k];
        if (image.camera != c) continue;
        const CaptureDetection& detection = *searched.at(image.target);
        TargetInImage& target = result.targets.emplace_back();
        target.target = dataset.rig.targets[image.target].name;
        target.num_points = static_cast<int>(image.observations.size());
        target.num_rejected = static_cast<int>(solution.captures[i].rejected_ids[k].size());
        target.num_second_pass = detection.num_second_pass;
        target.used = used.captures[i].images[k].observations.size() > 0;
        const std::optional<SquaredErrors> errors =
            ErrorsOf(seen, solution, used.captures[i], target.used ? used.captures[i].images[k] : image);
        if (errors) target.rms_px = errors->RmsPx();
        result.used = result.used || target.used;
        const auto reason = reason_of.find({i, k});
        const std::string note = NoteOn(target, detection, reason == reason_of.end() ? "" : reason->second);
        if (!target.used) target.reason = note;
        if (!note.empty()) reasons.Add(note, target.target);
      }
      if (result.used) result.move_without = moves[c][i];
      result.reason = reasons.Text(is_only_target);
      if (!result.targets.empty()) continue;
      result.reason = WhyNotSeen(calibrated, i, is_only_target ? searched : DetectionOfTarget());
    }
  }
  return results;
}

std::vector<CapturePoses> CaptureResults(const Dataset& dataset, const Problem& used, const Solution& solution) {
  std::vector<CapturePoses> results;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const std::vector<Rigid3d>& base_from_gripper = dataset.captures[i].base_from_gripper;
    CapturePoses& result = results.emplace_back();
    result.name = dataset.captures[i].name;
    result.base_from_gripper = base_from_gripper;
    const std::vector<ProblemImage>& images = used.captures[i].images;
    const bool is_used = std::any_of(images.begin(), images.end(),
                                     [](const ProblemImage& image) { return image.observations.size() > 0; });
    if (!is_used || solution.captures[i].corrections.empty()) continue;
    const std::vector<Rigid3d> corrected =
        Corrected(WithErrors(used.captures[i], solution.effects), solution.captures[i].corrections);
    for (size_t r = 0; r < corrected.size(); ++r) {
      result.corrections.push_back(Inverse(used.captures[i].base_from_gripper[r]) * corrected[r]);
    }
  }
  return results;
}

std::vector<ImageResult> WithHeldOutDistances(std::vector<ImageResult> images, const Dataset& dataset,
                                              const std::vector<DistancesOfCaptures>& of_cameras) {
  std::map<std::pair<std::string, std::string>, std::pair<double, int>> squares_of;
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    for (const auto& [capture, distance_m] : of_cameras[c]) {
      auto& [sum_m2, number] = squares_of[{dataset.captures[capture].name, dataset.rig.cameras[c].name}];
      sum_m2 += distance_m * distance_m;
      ++number;
    }
  }
  for (ImageResult& image : images) {
    const auto squares = squares_of.find({image.capture, image.camera});
    if (squares == squares_of.end()) continue;
    const auto& [sum_m2, number] = squares->second;
    image.holdout_target_mm = 1000 * std::sqrt(sum_m2 / number);
  }
  return images;
}

std::vector<ImageResult> LeftOutResults(const Dataset& dataset) {
  std::vector<ImageResult> results;
  for (const LeftOutImages& entry : dataset.left_out) {
    const size_t first = results.size();
    for (size_t c = 0; c < entry.images.size(); ++c) {
      if (entry.images[c].empty()) continue;
      results.push_back({entry.capture,
                         dataset.rig.cameras[c].name,
                         entry.images[c].filename().string(),
                         false,
                         entry.reason,
                         {},
                         false});
    }
    if (results.size() > first) continue;
    const bool is_only = dataset.rig.cameras.front().name.empty();
    results.push_back({entry.name, "", is_only ? entry.name : "", false, entry.reason, {}, false});
  }
  return results;
}

std::vector<ImageResult> InOrderOfCaptures(std::vector<ImageResult> images, const Dataset& dataset) {
  std::map<std::string, size_t> place_of;
  for (size_t i = 0; i < dataset.captures.size(); ++i) place_of.emplace(dataset.captures[i].name, i);
  const auto place = [&](const ImageResult& image) {
    const auto found = place_of.find(image.capture);
    return found == place_of.end() ? place_of.size() : found->second;
  };
  for (ImageResult& image : images) {
    const auto found = place_of.find(image.capture);
    if (found != place_of.end()) image.role = dataset.captures[found->second].role;
  }
  std::stable_sort(images.begin(), images.end(),
                   [&](const ImageResult& a, const ImageResult& b) { return place(a) < place(b); });
  return images;
}

}  // namespace heba
