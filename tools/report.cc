#include "tools/report.h"

#include <algorithm>
#include <cmath>

#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/verdict.h"
#include "tools/charts.h"
#include "tools/page.h"
#include "tools/run_figures.h"

namespace heba {
namespace {

std::string Heading(const std::string& text) { return "<h2>" + Escaped(text) + "</h2>\n"; }
std::string Paragraph(const std::string& text) { return "<p>" + Escaped(text) + "</p>\n"; }

std::string VerdictSection(const RunResult& result) {
  const Verdict verdict = JudgeRun(result);
  const std::string grade(GradeName(verdict.grade));
  std::string section =
      "<p class=\"verdict " + grade + "\">This calibration is <strong>" + grade + "</strong>.</p>\n<ul>\n";
  for (const Finding& finding : verdict.findings) {
    section += "<li class=\"" + std::string(GradeName(finding.grade)) + "\">" + Escaped(finding.what);
    if (!finding.cure.empty()) section += ". <em>" + Escaped(finding.cure) + ".</em>";
    section += "</li>\n";
  }
  return section + "</ul>\n";
}

std::string PoseSection(const RunResult& result, const Estimate& refined) {
  const std::string mount(CameraMountName(result.setup));
  return Heading("Result") + "<p><code>" + Escaped(mount) + "_from_camera</code> " +
         Escaped(PoseText(refined.hand_eye.camera_mount_from_camera)) + "<br>\n<code>" +
         Escaped(std::string(TargetMountName(result.setup))) + "_from_target</code> " +
         Escaped(PoseText(refined.hand_eye.target_mount_from_target)) + "</p>\n";
}

std::string UncertaintySection(const Estimate& refined) {
  const Covariance& covariance = refined.solution->covariance;
  const Eigen::Matrix3d translation = 1e6 * covariance.matrix.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = std::pow(RadToDeg(1.0), 2) * covariance.matrix.block<3, 3>(3, 3);
  const auto of_pair = [](const Eigen::Matrix3d& matrix, Eigen::Index i, Eigen::Index j) {
    Eigen::Matrix2d pair;
    pair << matrix(i, i), matrix(i, j), matrix(j, i), matrix(j, j);
    return pair;
  };
  std::string section = Heading("Uncertainty of the camera's pose") +
                        Paragraph("One sigma, in the camera's own axes (z along the optical axis).") +
                        "<div class=\"charts\">\n";
  section += EllipseChart(of_pair(translation, 0, 1), "x, mm", "y") +
             EllipseChart(of_pair(translation, 0, 2), "x, mm", "z") +
             EllipseChart(of_pair(rotation, 0, 1), "about x, deg", "y") +
             EllipseChart(of_pair(rotation, 0, 2), "about x, deg", "z") + "</div>\n";
  const Eigen::VectorXd scale = covariance.matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance.matrix * scale.asDiagonal();
  return section + "<details><summary>How the parameters hang together</summary>\n" +
         CorrelationChart(covariance.names, correlation) + "</details>\n";
}

std::string MethodsSection(const RunResult& result) {
  std::vector<BarLine> lines;
  std::vector<std::vector<PageCell>> rows;
  const bool has_truth = std::any_of(result.estimates.begin(), result.estimates.end(),
                                     [](const Estimate& estimate) { return estimate.errors.truth.has_value(); });
  const auto cell = [](const std::optional<double>& value) {
    return PageCell{value ? Significant(*value, 3) : "", true};
  };
  for (const Estimate& estimate : result.estimates) {
    const Errors& errors = estimate.errors;
    lines.push_back({estimate.method, errors.reprojection_rms_px, errors.holdout_rms_px});
    rows.push_back(
        {{estimate.method},
         cell(errors.reprojection_rms_px),
         cell(errors.holdout_rms_px),
         cell(errors.holdout_target_mm),
         cell(errors.holdout_target_deg),
         cell(errors.axxb_mean_mm),
         cell(errors.board_scatter ? std::optional<double>(errors.board_scatter->translation_rms_mm) : std::nullopt),
         {estimate.reason}});
    if (!has_truth) continue;
    const std::optional<TruthErrors>& truth = errors.truth;
    rows.back().insert(rows.back().end() - 1,
                       {cell(truth ? std::optional<double>(truth->hand_eye_mm) : std::nullopt),
                        cell(truth ? std::optional<double>(truth->hand_eye_deg) : std::nullopt)});
  }
  std::vector<std::string> head = {"method",        "in-sample, px", "hold-out, px", "hold-out, mm",
                                   "hold-out, deg", "AX-XB, mm",     "board, mm",    "remark"};
  if (has_truth) head.insert(head.end() - 1, {"true error, mm", "deg"});
  return Heading("Methods") +
         Paragraph(
             "How far predicted and observed points are apart (rms): on the captures that the estimate was made "
             "from, and on captures that it has not seen.") +
         BarChart(lines, "in-sample", "hold-out", "px") + HtmlTable(head, rows);
}

std::string ResidualSection(const Estimate& refined, const std::vector<CaptureResiduals>& residuals) {
  std::vector<Arrow> arrows;
  std::vector<Eigen::Vector2d> by_radius;
  std::vector<double> lengths;
  const Camera& camera = refined.camera;
  for (const CaptureResiduals& capture : residuals) {
    for (Eigen::Index i = 0; i < capture.pixels.cols(); ++i) {
      arrows.push_back({capture.pixels.col(i), capture.residuals.col(i)});
      lengths.push_back(capture.residuals.col(i).norm());
      const Eigen::Vector2d centre(camera.params[2], camera.params[3]);
      by_radius.emplace_back((capture.pixels.col(i) - centre).norm(), lengths.back());
    }
  }
  if (lengths.empty()) return "";
  const double median = Median(lengths);
  // So that a typical arrow is a fortieth of the picture wide.
  const double scale = std::pow(10, std::floor(std::log10(camera.width_px / 40.0 / std::max(median, 1e-9))));
  return Heading("Residuals") +
         Paragraph("Predicted minus observed, of every point of every capture, " + Significant(scale, 1) +
                   " times as long as they are. Where there are no arrows no capture says anything of the lens.") +
         ArrowField(camera.width_px, camera.height_px, arrows, scale) +
         ScatterChart(by_radius, "distance from the principal point, px", "residual, px");
}

std::string CaptureSection(const RunResult& result) {
  std::vector<std::vector<PageCell>> rows;
  bool has_corrections = false;
  for (const CaptureResult& capture : result.captures) has_corrections = has_corrections || capture.correction;
  for (const CaptureResult& capture : result.captures) {
    std::vector<PageCell> row = {{capture.image},
                                 {capture.used ? "used" : "not used"},
                                 {std::to_string(capture.num_points), true},
                                 {std::to_string(capture.num_rejected), true},
                                 {capture.rms_px ? Significant(*capture.rms_px, 3) : "", true}};
    if (has_corrections) {
      const bool has = capture.correction.has_value();
      row.push_back({has ? Significant(1000 * capture.correction->translation.norm(), 2) : "", true});
      row.push_back({has ? Significant(RadToDeg(LogRotation(capture.correction->rotation).norm()), 2) : "", true});
    }
    row.push_back({capture.reason});
    rows.push_back(std::move(row));
  }
  std::vector<std::string> head = {"capture", "", "points", "left out", "rms, px"};
  if (has_corrections) head.insert(head.end(), {"robot off by, mm", "deg"});
  head.emplace_back("remark");
  return Heading("Captures") + HtmlTable(head, rows);
}

}  // namespace

std::string ReportPage(const RunResult& result, const std::vector<CaptureResiduals>& residuals) {
  const Estimate* refined = FindRefined(result);
  std::string body = "<h1>" + Escaped(result.name) + "</h1>\n" +
                     Paragraph(std::string(SetupName(result.setup)) + ", " + result.target_type + ", " +
                               std::to_string(NumUsedCaptures(result)) + " of " +
                               std::to_string(result.captures.size()) + " captures used") +
                     VerdictSection(result);
  if (refined != nullptr) {
    body += PoseSection(result, *refined) + UncertaintySection(*refined);
  }
  body += MethodsSection(result);
  if (refined != nullptr) body += ResidualSection(*refined, residuals);
  return HtmlPage(result.name, body + CaptureSection(result));
}

}  // namespace heba
