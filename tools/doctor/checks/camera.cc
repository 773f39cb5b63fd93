// Checks whether the intrinsics belong to these images. They are judged by how well they fit the views of the target,
// compared with the intrinsics estimated from the images themselves, and by the robot's poses.
#include <algorithm>
#include <cmath>

#include "heba/base/median.h"
#include "heba/base/text.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/initial/intrinsics.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/run/captures.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

// Returns the camera of an image enlarged by `factor`; pixel (0, 0) is the centre of the first pixel.
Camera Scaled(const Camera& camera, double factor) {
  Camera scaled = camera;
  for (const size_t i : {0, 1}) scaled.params[i] *= factor;
  for (const size_t i : {2, 3}) scaled.params[i] = (camera.params[i] + 0.5) * factor - 0.5;
  return scaled;
}

Camera OfSize(Camera camera, const CaptureDetection& image) {
  camera.width_px = image.width_px;
  camera.height_px = image.height_px;
  return camera;
}

// Returns the median over views of the RMS residual under the view's own best pose; infinite if fewer than half of the
// views have a pose.
double FitPx(const Examination& examination, const Camera& camera) {
  const std::vector<ExaminedView> views = ExamineViews(examination.config.data, examination.detections, camera);
  if (2 * views.size() < NumSeen(examination.detections)) return std::numeric_limits<double>::infinity();
  std::vector<double> rms;
  for (const ExaminedView& view : views) rms.push_back(view.rms_px);
  return rms.empty() ? std::numeric_limits<double>::infinity() : Median(rms);
}

std::optional<PoseConsistency> ByRobot(const Examination& examination, const Camera& camera) {
  return FindPoseConsistency(CandidatesOf(ExamineViews(examination.config.data, examination.detections, camera)),
                             RobotScale::kOne);
}

std::string FocalText(const Camera& camera) { return Fixed(camera.params[0], 0) + " px"; }

// Estimates the camera that a run would estimate. If a pinhole is given, brown5 is estimated, because the lens may
// distort.
Outcome<Camera> EstimateCamera(const Dataset& data, const std::vector<View>& views, const CaptureDetection& image) {
  const std::string& model = data.rig.cameras.front().camera.model;
  if (model.empty()) {
    const Outcome<CameraChoice> choice = ChooseCameraModel(views, image.width_px, image.height_px);
    return choice ? Outcome<Camera>(choice->camera) : choice.failure();
  }
  return EstimateIntrinsics(views, data.has_camera.front() && model == "pinhole" ? "brown5" : model, image.width_px,
                            image.height_px);
}

// Reports that the camera model that the config names does not fit the lens, if another model fits single views
// decidedly better. Scales and poses that such a camera shows are wrong, so that the checks that follow see the other
// one.
Checked OtherModel(const Examination& examination, const Camera& camera, const std::vector<View>& views) {
  const CaptureDetection& image = examination.detections.front().detection;
  const std::string& named = camera.model;
  constexpr double kMattersPx = 0.1;
  constexpr double kDecidedly = 2.5;
  const double fit_px = FitPx(examination, camera);
  if (fit_px < kMattersPx) return {.camera = camera};
  const Outcome<CameraChoice> choice = ChooseCameraModel(views, image.width_px, image.height_px);
  if (!choice || choice->camera.model == named) return {.camera = camera};
  const double chosen_fit_px = FitPx(examination, choice->camera);
  if (!(kDecidedly * chosen_fit_px < fit_px)) return {.camera = camera};
  return {.symptoms = {{Severity::kWrong, "lens",
                        "the camera model " + named + " does not fit the lens: single views fit to " +
                            Significant(fit_px, 2) + " px with it, to " + Significant(chosen_fit_px, 2) + " px with " +
                            choice->camera.model,
                        "set camera.model: " + choice->camera.model + ", or leave it out to have it chosen"}},
          .camera = choice->camera};
}

// Reports that the camera in the file is for images of another size.
Checked OtherSize(const Examination& examination, const Camera& given, const std::optional<Camera>& estimated) {
  const CaptureDetection& image = examination.detections.front().detection;
  const double wider = static_cast<double>(image.width_px) / given.width_px;
  const double higher = static_cast<double>(image.height_px) / given.height_px;
  Symptom symptom{Severity::kWrong, "camera_size",
                  examination.config.data.camera_sources.front() + " is for images of " +
                      ImageSizeText(given.width_px, given.height_px) + ", but these are " +
                      ImageSizeText(image.width_px, image.height_px),
                  ""};
  constexpr double kSame = 0.01;
  const Camera scaled = OfSize(Scaled(given, wider), image);
  // The image may be a window in the middle of the larger one.
  Camera cropped = OfSize(given, image);
  cropped.params[2] -= 0.5 * (given.width_px - image.width_px);
  cropped.params[3] -= 0.5 * (given.height_px - image.height_px);
  const bool can_be_scaled = std::abs(wider / higher - 1) < kSame;
  const bool is_scaled = can_be_scaled && FitPx(examination, scaled) <= FitPx(examination, cropped);
  if (is_scaled) {
    symptom.what += ": scaled by " + Significant(wider, 4) + " (binned, or another resolution)";
    symptom.cure =
        "multiply fx, fy, cx + 0.5 and cy + 0.5 by " + Significant(wider, 4) + ", or calibrate at this resolution";
  } else {
    symptom.what += ": " + std::string(wider <= 1 && higher <= 1 ? "cropped" : "another aspect ratio");
    symptom.cure = "subtract the window's left and top from cx and cy, or calibrate at this resolution";
  }
  symptom.cure += "; or leave camera.intrinsics out to estimate them from these images";
  if (estimated) symptom.what += "; estimated from the images, the focal length is " + FocalText(*estimated);
  return {.symptoms = {std::move(symptom)}, .camera = estimated ? *estimated : is_scaled ? scaled : cropped};
}

// A fault of the given intrinsics, with the camera that the checks that follow use instead.
struct CameraFault {
  Symptom symptom;
  Camera camera;
};

// Returns the fault of intrinsics that are for images half or twice as large; nothing if they are not. `fit_px` is
// FitPx of `camera`.
std::optional<CameraFault> FindOtherResolution(const Examination& examination, const Camera& camera, double fit_px) {
  const std::optional<PoseConsistency> by_robot = ByRobot(examination, camera);
  // Intrinsics of another resolution are only reported if both the views and the robot's poses support it.
  constexpr double kDecidedly = 2.5;
  for (const double factor : {2.0, 0.5}) {
    const Camera scaled = Scaled(camera, factor);
    const std::optional<PoseConsistency> then = ByRobot(examination, scaled);
    if (!by_robot || !then || !(FitPx(examination, scaled) < fit_px)) continue;
    if (kDecidedly * then->typical_misfit_m >= by_robot->typical_misfit_m) continue;
    return CameraFault{{Severity::kWrong, "camera_scale",
                        "the intrinsics of " + examination.config.data.camera_sources.front() + " are for images " +
                            (factor > 1 ? "half" : "twice") + " as large: with " + Fixed(factor, 1) +
                            " times the focal length and principal point, robot and images differ by " +
                            MisfitText(*then) + ", with the given ones by " + MisfitText(*by_robot),
                        "provide the intrinsics of this resolution, or leave camera.intrinsics out to estimate them"},
                       scaled};
  }
  return std::nullopt;
}

// Returns the fault of intrinsics that fit single views decidedly worse than the estimated ones; nothing if they do
// not. `fit_px` is FitPx of `camera`.
std::optional<CameraFault> FindOtherLens(const Examination& examination, const Camera& camera, const Camera& estimated,
                                         double fit_px) {
  const double estimated_fit_px = FitPx(examination, estimated);
  const double ratio = estimated.params[0] / camera.params[0];
  constexpr double kPoorPx = 0.5;
  constexpr double kPoorRatio = 2.5;
  const std::string fits = "single views fit to " + Significant(fit_px, 2) + " px with the given intrinsics, to " +
                           Significant(estimated_fit_px, 2) + " px with those estimated from the images";
  if (!std::isfinite(estimated_fit_px) || fit_px < kPoorPx || fit_px < kPoorRatio * estimated_fit_px) {
    return std::nullopt;
  }
  constexpr double kOther = 0.08;
  const bool is_other_lens = std::abs(ratio - 1) > kOther;
  // Slightly more than noise is a remark, because nominal intrinsics are often good enough.
  const bool is_wrong = fit_px > 4 * kPoorPx || is_other_lens;
  return CameraFault{
      {is_wrong ? Severity::kWrong : Severity::kRemark,
       is_other_lens ? SymptomCode("camera") : SymptomCode("distortion"),
       is_other_lens ? "the intrinsics belong to another camera or resolution: " + fits + "; focal length " +
                           FocalText(camera) + " given, " + FocalText(estimated) + " estimated from the images"
                     : "the distortion of the lens differs from that of the intrinsics: " + fits,
       "provide the intrinsics of this camera at this resolution, or leave camera.intrinsics out to have them "
       "estimated (camera.model: " +
           estimated.model + ")"},
      estimated};
}

// Returns what is wrong with the given intrinsics of images of the right size; nothing if they fit.
std::optional<CameraFault> FindFault(const Examination& examination, const Camera& camera,
                                     const std::optional<Camera>& estimated) {
  const double fit_px = FitPx(examination, camera);
  std::optional<CameraFault> fault = FindOtherResolution(examination, camera, fit_px);
  if (!fault && estimated) fault = FindOtherLens(examination, camera, *estimated, fit_px);
  return fault;
}

}  // namespace

Checked Check_camera(const Examination& examination) {
  const Dataset& data = examination.config.data;
  const CaptureDetection& image = examination.detections.front().detection;
  const std::vector<View> views = ViewsOf(data, examination.detections);
  std::optional<Camera> estimated;
  if (!views.empty()) {
    const Outcome<Camera> found = EstimateCamera(data, views, image);
    if (found) {
      estimated = *found;
    } else if (!data.has_camera.front()) {
      return {{{Severity::kWrong, "no_camera",
                "the intrinsics cannot be estimated from these images: " + FailureText(found.failure()),
                "provide them (camera.intrinsics), or take more captures with the target tilted"}}};
    }
  }
  const Camera& given = data.rig.cameras.front().camera;
  if (!data.has_camera.front()) {
    if (estimated && !given.model.empty()) return OtherModel(examination, *estimated, views);
    return {.camera = estimated};
  }
  if (given.width_px != 0 && (given.width_px != image.width_px || given.height_px != image.height_px)) {
    return OtherSize(examination, given, estimated);
  }
  const Camera camera = OfSize(given, image);
  if (views.empty()) return {.camera = camera};
  const std::optional<CameraFault> fault = FindFault(examination, camera, estimated);
  if (!fault) return {.camera = camera};
  return {.symptoms = {fault->symptom}, .camera = fault->camera};
}

}  // namespace heba
