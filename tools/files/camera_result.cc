#include "tools/files/camera_result.h"

#include <cmath>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/camera/camera_model.h"
#include "heba/io/camera_file.h"
#include "heba/io/export.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

constexpr const char* kSchema = "heba/camera/1";

// Returns the covariance of the camera with the names of its parameters.
Covariance NamedCovariance(const CameraCalibration& calibration) {
  Covariance covariance;
  covariance.layout.AddCamera(kCameraBlock, calibration.camera.Model(),
                              std::vector<bool>(calibration.camera.params.size(), true));
  covariance.matrix = calibration.covariance;
  return covariance;
}

Json LensJson(const LensFit& lens) {
  Json json{{"model", lens.model}, {"ok", lens.camera.has_value()}, {"reason", FailureText(lens.reason)}};
  if (!lens.camera) return json;
  json["rms_px"] = Finite(lens.rms_px);
  json["holdout_rms_px"] = lens.holdout_rms_px ? Finite(*lens.holdout_rms_px) : Json(nullptr);
  json["log_likelihood"] = Finite(lens.log_likelihood);
  json["camera"] = CameraJson(*lens.camera);
  return json;
}

}  // namespace

std::string CameraResultToJson(const std::string& name, const std::vector<std::pair<std::string, std::string>>& about,
                               const CameraCalibration& calibration, const CameraMap& map,
                               const std::vector<UnusedImage>& unused) {
  const Covariance covariance = NamedCovariance(calibration);
  Json json{{"schema", kSchema}, {"heba", Version()}, {"name", name}};
  for (const auto& [key, text] : about) json["about"][key] = text;
  json["camera"] = CameraJson(calibration.camera, &covariance, std::string(kCameraBlock));
  json["covariance"] = Json{{"order", covariance.layout.Names()}, {"matrix", MatrixJson(covariance.matrix)}};
  json["covariance_dof"] = Finite(calibration.covariance_dof);
  json["pixel_sigma"] = Finite(calibration.pixel_sigma_px);
  const LensFit& chosen = calibration.lenses[calibration.chosen];
  json["errors"] = Json{{"reprojection_rms_px", Finite(chosen.rms_px)},
                        {"holdout_rms_px", chosen.holdout_rms_px ? Finite(*chosen.holdout_rms_px) : Json(nullptr)}};
  json["target_shape"] = Json{{"bend_x_m", Finite(calibration.shape.params[2])},
                              {"bend_y_m", Finite(calibration.shape.params[3])},
                              {"twist_m", Finite(calibration.shape.params[4])}};
  json["lenses"] = Json::array();
  for (const LensFit& lens : calibration.lenses) json["lenses"].push_back(LensJson(lens));
  json["projection"] = Json{{"columns", map.columns}, {"rows", map.rows}, {"sigmas_px", Json::array()}};
  for (const double sigma_px : map.sigmas_px) json["projection"]["sigmas_px"].push_back(Finite(sigma_px));
  json["projection"]["points"] = map.num_points;
  json["captures"] = Json::array();
  for (const CameraViewOutcome& view : calibration.views) {
    Json entry{{"image", view.name}, {"used", view.used}};
    if (view.used) {
      entry["rms_px"] = Finite(view.rms_px);
      entry["rejected"] = view.num_rejected;
      entry["camera_from_target"] = PoseJson(view.camera_from_target, "camera", "target");
    }
    json["captures"].push_back(std::move(entry));
  }
  for (const UnusedImage& image : unused) {
    json["captures"].push_back(Json{{"image", image.image}, {"used", false}, {"reason", image.reason}});
  }
  return FileText(json);
}

std::vector<std::pair<std::string, std::string>> CameraFiles(const std::string& name,
                                                             const CameraCalibration& calibration) {
  std::string own = CameraToYaml(calibration.camera);
  if (!own.ends_with('\n')) own += '\n';
  // The first four are fx, fy, cx and cy in every model.
  constexpr size_t kFirstDistortion = 4;
  std::vector<std::string> sigmas;
  std::vector<std::string> of_distortion;
  const std::vector<std::string>& names = calibration.camera.Model().param_names();
  for (size_t i = 0; i < names.size(); ++i) {
    const auto place = static_cast<Eigen::Index>(i);
    const std::string sigma = RoundTrip(std::sqrt(calibration.covariance(place, place)));
    if (i < kFirstDistortion) {
      sigmas.push_back(names[i] + ": " + sigma);
    } else {
      of_distortion.push_back(sigma);
    }
  }
  if (!of_distortion.empty()) sigmas.push_back("distortion: [" + Join(of_distortion, ", ") + "]");
  std::vector<std::pair<std::string, std::string>> files = {
      {"camera.yaml", own + "std: {" + Join(sigmas, ", ") + "}\n"}};
  ExportRequest request;
  request.name = name;
  request.method = kBundleMethod;
  request.camera = calibration.camera;
  request.parent_frame = "camera_mount";
  request.child_frame = "camera_optical_frame";
  for (const char* format_name : {"camera_info", "opencv", "kalibr", "mrcal"}) {
    const ExportFormat* const format = FindEntry(ExportFormats(), format_name);
    CHECK(format != nullptr);
    const Outcome<std::string> text = ExportText(*format, request);
    if (text) files.emplace_back(format->file_name, *text);
  }
  return files;
}

}  // namespace heba
