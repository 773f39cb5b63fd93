// The report's charts as still pictures (chart_picture.h). Each is markup, empty where there is nothing to draw.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "tools/pages/report.h"

namespace heba {

std::string MethodsPicture(const RunResult& result);
std::string ResidualFieldPicture(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string CoveragePicture(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string ResidualRadiusPicture(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string HistogramPicture(double sigma_px, const std::vector<ReportedCapture>& captures);
std::string CaptureBarsPicture(const RunResult& result);
// Seen from above, the base's x to the right and y upwards: where base, cameras and targets stand.
std::string SetUpPicture(const RunResult& result, const Estimate& refined, const std::vector<ReportedCapture>& captures,
                         const Eigen::Vector3d& target_middle);
// A region of two coordinates: one sigma, and 95 %.
std::string EllipsePicture(const std::string& x, const std::string& y, const Eigen::Matrix2d& covariance,
                           double reach_95);
std::string CorrelationPicture(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation);

}  // namespace heba
