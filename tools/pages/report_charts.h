// The charts of the report as static SVG (static_chart.h). Each function returns markup, empty if there is no data.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "tools/pages/report_data.h"

namespace heba {

std::string MethodsChart(const RunResult& result);
std::string ResidualFieldChart(const CameraResiduals& camera);
std::string CoverageChart(const CameraResiduals& camera);
std::string ResidualRadiusChart(const CameraResiduals& camera);
std::string HistogramChart(const CameraResiduals& camera);
// Images without an RMS have no bar.
std::string CaptureBarsChart(const CameraResiduals& camera);
// Returns a chart of the one-sigma ellipse and the 95 % ellipse of two coordinates. `reach_95` is the size of the
// latter in sigmas.
std::string EllipseChart(const std::string& x, const std::string& y, const Eigen::Matrix2d& covariance,
                         double reach_95);
std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation);

}  // namespace heba
