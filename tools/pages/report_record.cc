#include "tools/pages/report_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <set>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/pose_formats.h"
#include "heba/io/result_file.h"
#include "tools/pages/page.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Returns the text with a capital first letter, and with a full stop unless it already ends a sentence.
std::string Sentence(const std::string& text) {
  const bool has_end = text.ends_with('.') || text.ends_with('?') || text.ends_with('!');
  return Capitalised(text) + (has_end ? "" : ".");
}

std::string FindingItem(const Finding& finding) {
  std::string item =
      "<li class=\"" + std::string(GradeName(finding.grade)) + "\">" + EscapedForMarkup(Sentence(finding.text));
  if (!finding.action.empty()) item += " <em>" + EscapedForMarkup(Sentence(finding.action)) + "</em>";
  return item + "</li>\n";
}

// Shows the figures that users need first.
std::string TilesPart(const RunResult& result, const Estimate& refined) {
  std::string tiles = "<dl class=\"tiles\">\n";
  const auto add = [&](const std::string& name, const std::string& value) {
    tiles += "<div><dt>" + EscapedForMarkup(name) + "</dt><dd>" + EscapedForMarkup(value) + "</dd></div>\n";
  };
  const Solution& solution = *refined.solution;
  const Errors& errors = refined.errors;
  const auto largest = [](const Eigen::Matrix3d& block) { return std::sqrt(block.diagonal().maxCoeff()); };
  const Eigen::MatrixXd& covariance = solution.covariance.matrix;
  add("camera position, one sigma (worst axis)", ShownAmount(1000 * largest(covariance.block<3, 3>(0, 0)), 3) + " mm");
  add("camera orientation, one sigma (worst axis)",
      ShownAmount(RadToDeg(largest(covariance.block<3, 3>(3, 3))), 3) + " deg");
  if (result.working_point) {
    add("target at " + Significant(1000 * result.working_point->in_camera_m.norm(), 3) + " mm, one sigma (worst axis)",
        ShownAmount(1000 * largest(result.working_point->covariance_m2), 3) + " mm");
  }
  if (errors.holdout_target_mm) add("hold-out error at the target", FigureText(errors.holdout_target_mm) + " mm");
  if (errors.holdout_rms_px) add("hold-out RMS", FigureText(errors.holdout_rms_px) + " px");
  add("pixel noise", Significant(solution.pixel_sigma_px, 3) + " px");
  if (solution.robot_noise) {
    add("robot noise", RobotNoiseText(*solution.robot_noise, solution.smooth_noise));
  }
  return tiles + "</dl>\n";
}

// Returns one sigma of each number of the pose in `format`. `covariance` is in the tangent space of the pose, in the
// child's frame; it is propagated by numeric differentiation.
std::vector<double> SigmasOfNumbers(const PoseFormat& format, const Rigid3d& pose, const Matrix6& covariance) {
  const std::vector<double> numbers = NumbersFromPose(format, pose);
  constexpr double kStep = 1e-6;
  Matrix6 moved;
  for (int i = 0; i < 6; ++i) {
    const std::vector<double> near = NumbersFromPose(format, Retract(pose, kStep * Tangent6::Unit(i)));
    for (int k = 0; k < 6; ++k) {
      const double change = near[static_cast<size_t>(k)] - numbers[static_cast<size_t>(k)];
      // Angles may wrap around at 180 degrees.
      moved(k, i) = (k < 3 ? change : std::remainder(change, 360)) / kStep;
    }
  }
  const Matrix6 of_numbers = moved * covariance * moved.transpose();
  std::vector<double> sigmas;
  for (int k = 0; k < 6; ++k) sigmas.push_back(std::sqrt(std::max(of_numbers(k, k), 0.0)));
  return sigmas;
}

std::string MatrixText(const Rigid3d& pose) {
  const Eigen::Matrix4d matrix = pose.Matrix();
  std::string text;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      const int decimals = row == 3 ? 0 : 9;
      text += PadLeft(Fixed(matrix(row, column), decimals), 14);
    }
    text += row < 3 ? "\n" : "";
  }
  return text;
}

std::string QuaternionText(const Rigid3d& pose) {
  const double sign = pose.rotation.w() < 0 ? -1 : 1;
  std::vector<std::string> q;
  for (int i = 0; i < 4; ++i) q.push_back(Fixed(sign * pose.rotation.coeffs()[i], 9));
  return Join(q, " ");
}

std::string PosePart(const std::string& name, const Rigid3d& pose, const std::optional<Matrix6>& covariance) {
  const PoseFormat rpy{"", {"x", "y", "z", "roll", "pitch", "yaw"}, "mm", "extrinsic_xyz", "deg"};
  const std::vector<double> numbers = NumbersFromPose(rpy, pose);
  const std::vector<double> sigmas = covariance ? SigmasOfNumbers(rpy, pose, *covariance) : std::vector<double>(6, 0.0);
  constexpr int kWithoutSigma = 3;
  constexpr int kMostDecimals = 6;
  std::vector<std::vector<PageCell>> rows;
  for (size_t i = 0; i < numbers.size(); ++i) {
    const std::string unit = i < 3 ? " mm" : " deg";
    const int decimals = covariance ? DecimalsFor(sigmas[i], kMostDecimals) : kWithoutSigma;
    rows.push_back({{rpy.columns[i]},
                    {Fixed(numbers[i], decimals) + unit, true},
                    {covariance ? ShownAmount(sigmas[i], 2) + unit : "unknown", true}});
  }
  return "<div>\n<h3><code>" + EscapedForMarkup(name) + "</code></h3>\n" + HtmlTable({"", "value", "one sigma"}, rows) +
         Paragraph("4 x 4 matrix, translation in m:") + CopyableText(MatrixText(pose)) +
         Paragraph("x y z in m, quaternion x y z w:") +
         CopyableText(Fixed(pose.translation.x(), 9) + " " + Fixed(pose.translation.y(), 9) + " " +
                      Fixed(pose.translation.z(), 9) + " " + QuaternionText(pose)) +
         "</div>\n";
}

std::optional<Matrix6> PoseCovariance(const Estimate& estimate, const std::string& pose) {
  return estimate.solution ? PoseCovarianceOf(estimate.solution->covariance, pose) : std::nullopt;
}

std::string CameraPart(const Estimate& estimate) {
  if (estimate.camera.params.empty()) return "";
  return IntrinsicsTable("Camera", estimate.camera, estimate.solution ? estimate.solution->covariance : Covariance(),
                         "camera");
}

// Returns the refined estimate, or the last successful one if there is none.
const Estimate* FinalEstimate(const RunResult& result) {
  if (const Estimate* refined = FindRefined(result)) return refined;
  for (size_t i = result.estimates.size(); i-- > 0;) {
    if (result.estimates[i].ok) return &result.estimates[i];
  }
  return nullptr;
}

std::string ResultPart(const RunResult& result) {
  const Estimate* estimate = FinalEstimate(result);
  if (estimate == nullptr) return "";
  return Heading("Result (" + estimate->method + ")") + "<div class=\"columns\">\n" +
         PosePart(std::string(CameraMountName(result.setup)) + "_from_camera",
                  estimate->hand_eye.camera_mount_from_camera, PoseCovariance(*estimate, "hand_eye")) +
         PosePart(std::string(TargetMountName(result.setup)) + "_from_target",
                  estimate->hand_eye.target_mount_from_target, PoseCovariance(*estimate, "board")) +
         CameraPart(*estimate) + "</div>\n" +
         Paragraph(
             "Roll, pitch and yaw are rotations about the fixed axes x, y and z, in this order. The camera has "
             "OpenCV's axes: x right, y down, z forward.");
}

}  // namespace

std::string ShellWord(const std::string& text) {
  const bool is_plain = std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("/._-+").find(c) != std::string_view::npos;
  });
  if (is_plain) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string NextPart(const Verdict& verdict, const ReportContext& context, const std::string& located) {
  std::string part = Heading("Next steps");
  std::set<std::string> told;
  std::string actions;
  for (const Finding& finding : verdict.findings) {
    if (finding.grade == Grade::kGood || finding.action.empty() || !told.insert(finding.action).second) continue;
    actions += "<li>" + EscapedForMarkup(Sentence(finding.action)) + "</li>\n";
  }
  if (!actions.empty()) part += "<ol>\n" + actions + "</ol>\n";
  if (verdict.grade == Grade::kBad) return part + Paragraph("Do not use this result.");
  const std::string run = ShellWord(context.output.string());
  part += Paragraph(
              "These commands export the result for other software (ros2, urdf, opencv, kuka, ...; all writes every "
              "format) and locate the target in a new image:") +
          CopyableText("heba export " + run + " --to ros2");
  return located.empty() ? part : part + CopyableText("heba locate " + run + " " + located);
}

std::string RecordPart(std::vector<std::pair<std::string, std::string>> facts,
                       const std::vector<std::pair<std::string, std::string>>& about, const ReportContext& context) {
  facts.insert(facts.end(), about.begin(), about.end());
  facts.insert(facts.end(), {{"created", context.made + " by heba " + std::string(Version())},
                             {"config", context.config.string()},
                             {"folder", context.output.string()}});
  std::string part = Heading("Record") + "<dl class=\"record\">\n";
  for (const auto& [name, value] : facts) {
    part += "<dt>" + EscapedForMarkup(name) + "</dt><dd>" + EscapedForMarkup(value) + "</dd>\n";
  }
  return part + "</dl>\n";
}

std::string FiguresTable(std::vector<std::string> head, const std::vector<FigureTitle>& more,
                         const std::vector<FigureLine>& lines) {
  std::vector<FigureTitle> columns = {{"in-sample, px", &CameraFigures::reprojection_rms_px},
                                      {"hold-out, px", &CameraFigures::holdout_rms_px},
                                      {"hold-out, mm", &CameraFigures::holdout_target_mm},
                                      {"hold-out, deg", &CameraFigures::holdout_target_deg}};
  columns.insert(columns.end(), more.begin(), more.end());
  const bool has_truth =
      std::any_of(lines.begin(), lines.end(), [](const FigureLine& line) { return line.figures.truth_mm.has_value(); });
  if (has_truth) {
    columns.push_back({"true error, mm", &CameraFigures::truth_mm});
    columns.push_back({"deg", &CameraFigures::truth_deg});
  }
  for (const FigureTitle& column : columns) head.emplace_back(column.title);
  std::vector<std::vector<PageCell>> rows;
  for (const FigureLine& line : lines) {
    std::vector<PageCell>& row = rows.emplace_back(line.begin);
    for (const FigureTitle& column : columns) {
      const std::optional<double>& value = line.figures.*column.figure;
      row.push_back({value ? Significant(*value, 3) : "", true});
    }
  }
  return HtmlTable(head, rows);
}

std::vector<PageCell> MoveCells(const std::optional<CaptureMove>& move) {
  return {{move ? Significant(1000 * move->tangent.head<3>().norm(), 2) : "", true},
          {move ? Significant(RadToDeg(move->tangent.tail<3>().norm()), 2) : "", true},
          {move ? ShownPValue(move->p_value) : "", true}};
}

std::string TimeNow() {
  std::time_t now = std::time(nullptr);
  double epoch = 0;
  const char* asked = std::getenv("SOURCE_DATE_EPOCH");
  if (asked != nullptr && ParseDouble(asked, &epoch) && epoch >= 0 && epoch < 1e11)
    now = static_cast<std::time_t>(epoch);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M UTC", &utc);
  return text.data();
}

std::string VerdictPart(const Verdict& verdict) {
  const std::string grade(GradeName(verdict.grade));
  std::string causes;
  std::string signs;
  std::string good;
  size_t num_good = 0;
  for (const Finding& finding : verdict.findings) {
    const bool is_good = finding.grade == Grade::kGood;
    num_good += is_good ? 1 : 0;
    (is_good ? good : (finding.is_cause ? causes : signs)) += FindingItem(finding);
  }
  const auto list = [](const std::string& items) { return "<ul class=\"findings\">\n" + items + "</ul>\n"; };
  std::string part = "<p class=\"verdict " + grade + "\">This calibration is <strong>" + grade + "</strong>.</p>\n";
  if (!causes.empty()) part += "<h3>Cause</h3>\n" + list(causes);
  if (!signs.empty()) part += (causes.empty() ? "<h3>Points to check</h3>\n" : "<h3>Symptoms</h3>\n") + list(signs);
  if (!good.empty()) {
    part += verdict.grade == Grade::kGood
                ? list(good)
                : Details("Checks that passed (" + std::to_string(num_good) + ")", list(good));
  }
  return part;
}

std::string IntrinsicsTable(const std::string& title, const Camera& camera, const Covariance& covariance,
                            const std::string& block, const Camera* truth) {
  const std::vector<std::string>& names = camera.Model().param_names();
  const bool has_truth = truth != nullptr && truth->model == camera.model;
  std::vector<std::string> head = {"", "value", "one sigma"};
  if (has_truth) head.emplace_back("true error");
  std::vector<std::vector<PageCell>> rows;
  constexpr int kMostDecimals = 8;
  for (size_t i = 0; i < camera.params.size(); ++i) {
    const std::optional<double> sigma = SigmaOf(covariance, block + "." + names[i]);
    rows.push_back(
        {{names[i]},
         {sigma ? Fixed(camera.params[i], DecimalsFor(*sigma, kMostDecimals)) : Significant(camera.params[i], 7), true},
         {sigma ? ShownAmount(*sigma, 2) : "held", true}});
    if (has_truth) rows.back().push_back({Significant(camera.params[i] - truth->params[i], 2), true});
  }
  return "<div>\n<h3>" + EscapedForMarkup(title) + ": " + EscapedForMarkup(camera.model) + ", " +
         std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + " px</h3>\n" +
         HtmlTable(head, rows) + "</div>\n";
}

std::string RecordSection(const RunResult& result, const ReportContext& context) {
  const Estimate* refined = FindRefined(result);
  const bool is_fixed = result.setup == Setup::kEyeToHand;
  const std::string setup = std::string(SetupName(result.setup)) +
                            (is_fixed ? ": the camera is fixed beside the robot" : ": the robot carries the camera");
  return "<div class=\"record-page\">\n<h1>" + EscapedForMarkup(result.name) + "</h1>\n" + VerdictPart(result.verdict) +
         (refined == nullptr ? "" : TilesPart(result, *refined)) + ResultPart(result) +
         NextPart(result.verdict, context, refined == nullptr ? "" : (is_fixed ? "IMAGE" : "IMAGE --pose NUMBERS")) +
         RecordPart({{"setup", setup},
                     {"target", result.target_type + ", " + std::to_string(result.num_target_points) + " points"},
                     {"captures", std::to_string(NumUsedCaptures(result)) + " of " +
                                      std::to_string(result.captures.size()) + " used"}},
                    result.about, context) +
         "</div>\n";
}

}  // namespace heba
