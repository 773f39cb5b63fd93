#include "tools/text/camera_figures.h"

#include <cmath>

#include "heba/base/units.h"

namespace heba {

CameraFigures FiguresOf(const Estimate* estimate) {
  CameraFigures figures;
  if (estimate == nullptr) return figures;
  const Errors& errors = estimate->errors;
  figures.reprojection_rms_px = errors.reprojection_rms_px;
  figures.holdout_rms_px = errors.holdout_rms_px;
  figures.holdout_target_mm = errors.holdout_target_mm;
  figures.holdout_target_deg = errors.holdout_target_deg;
  figures.holdout_chi2 = errors.holdout_chi2;
  figures.axxb_mean_mm = errors.axxb_mean_mm;
  if (errors.board_scatter) {
    figures.board_mm = errors.board_scatter->translation_rms_mm;
    figures.board_deg = errors.board_scatter->rotation_rms_deg;
  }
  if (estimate->solution) {
    figures = WithSigmas(figures, PoseCovarianceOf(estimate->solution->covariance, kHandEyeBlock));
    figures.pixel_sigma_px = estimate->solution->pixel_sigma_px;
  }
  if (errors.truth) {
    figures.truth_mm = errors.truth->hand_eye_mm;
    figures.truth_deg = errors.truth->hand_eye_deg;
  }
  return figures;
}

CameraFigures FiguresOf(const RunResult& result, size_t camera) {
  const CameraErrors& errors = result.errors[camera];
  CameraFigures figures;
  figures.reprojection_rms_px = errors.reprojection_rms_px;
  figures.holdout_rms_px = errors.holdout_rms_px;
  figures.holdout_target_mm = errors.holdout_target_mm;
  figures.holdout_target_deg = errors.holdout_target_deg;
  figures.holdout_chi2 = result.holdout_chi2;
  figures =
      WithSigmas(figures, PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(result.rig.cameras[camera])));
  if (camera < result.solution.pixel_sigmas_px.size()) {
    figures.pixel_sigma_px = result.solution.pixel_sigmas_px[camera];
  }
  figures.truth_mm = errors.truth_mm;
  figures.truth_deg = errors.truth_deg;
  return figures;
}

CameraFigures WithSigmas(CameraFigures figures, const std::optional<Eigen::Matrix<double, 6, 6>>& covariance) {
  if (!covariance) return figures;
  figures.sigma_mm = 1000 * std::sqrt(covariance->diagonal().head<3>().sum());
  figures.sigma_deg = RadToDeg(std::sqrt(covariance->diagonal().tail<3>().sum()));
  return figures;
}

}  // namespace heba
