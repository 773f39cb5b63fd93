// The report's charts as still pictures (static_chart.h). Each is markup, empty where there is nothing to draw.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "tools/pages/report.h"

namespace heba {

std::string MethodsChart(const RunResult& result);
std::string ResidualFieldChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string CoverageChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string ResidualRadiusChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string HistogramChart(double sigma_px, const std::vector<ReportedCapture>& captures);
std::string CaptureBarsChart(const RunResult& result);
// Seen from above, the base's x to the right and y upwards: where base, cameras and targets stand.
std::string SetUpChart(const RunResult& result, const Estimate& refined, const std::vector<ReportedCapture>& captures,
                       const Eigen::Vector3d& target_middle);
// A region of two coordinates: one sigma, and 95 %.
std::string EllipseChart(const std::string& x, const std::string& y, const Eigen::Matrix2d& covariance,
                         double reach_95);
std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation);

}  // namespace heba
