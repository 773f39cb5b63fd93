// The charts of the report as static SVG (static_chart.h). Each function returns markup, empty if there is no data.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "tools/pages/reported_capture.h"

namespace heba {

std::string MethodsChart(const RunResult& result);
std::string ResidualFieldChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string CoverageChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string ResidualRadiusChart(const Camera& camera, const std::vector<ReportedCapture>& captures);
std::string HistogramChart(double sigma_px, const std::vector<ReportedCapture>& captures);
// One RMS for each image in the order of the captures; images without one have no bar.
std::string CaptureBarsChart(const std::vector<std::optional<double>>& rms_px);
// Returns a chart of the one-sigma ellipse and the 95 % ellipse of two coordinates. `reach_95` is the size of the
// latter in sigmas.
std::string EllipseChart(const std::string& x, const std::string& y, const Eigen::Matrix2d& covariance,
                         double reach_95);
std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation);

}  // namespace heba
