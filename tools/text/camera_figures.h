// The figures of an estimate of one camera, which tables and pages show of single cameras and of those of a rig.
#pragma once

#include <optional>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"

namespace heba {

// Figures that do not exist are empty.
struct CameraFigures {
  std::optional<double> reprojection_rms_px = {};
  std::optional<double> holdout_rms_px = {};
  std::optional<double> holdout_target_mm = {};
  std::optional<double> holdout_target_deg = {};
  std::optional<double> holdout_chi2 = {};
  std::optional<double> axxb_mean_mm = {};
  std::optional<double> board_mm = {};
  std::optional<double> board_deg = {};
  // One sigma of the camera's pose as a whole: the root of the sum of the variances along, and about, its axes.
  std::optional<double> sigma_mm = {};
  std::optional<double> sigma_deg = {};
  std::optional<double> pixel_sigma_px = {};
  std::optional<double> truth_mm = {};
  std::optional<double> truth_deg = {};
};

// Returns no figures for null.
CameraFigures FiguresOf(const Estimate* estimate);
// Returns those of one camera of a rig. The sigmas are those of its pose in its mount.
CameraFigures FiguresOf(const RunResult& result, size_t camera);

// Returns figures with the sigmas by the covariance of the camera's pose (m, rad); the same if the pose was held.
CameraFigures WithSigmas(CameraFigures figures, const std::optional<Eigen::Matrix<double, 6, 6>>& covariance);

}  // namespace heba
