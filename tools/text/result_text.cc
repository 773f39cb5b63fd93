#include "tools/text/result_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "solvers/closed_form/hand_eye_method.h"

namespace heba {
std::vector<std::pair<std::string, std::string>> GroupedByReason(const std::vector<NamedReason>& named) {
  std::vector<std::pair<std::string, std::string>> names_of;
  for (const NamedReason& one : named) {
    const auto known =
        std::find_if(names_of.begin(), names_of.end(), [&](const auto& entry) { return entry.first == one.second; });
    if (known == names_of.end()) {
      names_of.emplace_back(one.second, one.first);
    } else {
      known->second += ", " + one.first;
    }
  }
  return names_of;
}

std::vector<std::pair<std::string, std::string>> MethodsWithoutResult(const RunResult& result,
                                                                      const std::vector<std::string>& asked_for) {
  std::vector<NamedReason> methods;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.ok) continue;
    const HandEyeMethod* const method = FindHandEyeMethod(estimate.method);
    const bool suits = method == nullptr || method->motion == MethodMotion::kAny;
    const bool is_asked_for = std::find(asked_for.begin(), asked_for.end(), estimate.method) != asked_for.end();
    if (suits || is_asked_for) methods.emplace_back(estimate.method, estimate.reason.ToString());
  }
  return GroupedByReason(methods);
}

std::pair<int, int> CountImages(const RunResult& result, const std::string& camera) {
  int used = 0;
  int all = 0;
  for (const ImageResult& image : result.images) {
    if (image.camera != camera || !image.was_searched) continue;
    ++all;
    used += image.used ? 1 : 0;
  }
  return {used, all};
}

std::pair<double, double> LargestSigmas(const Eigen::Matrix<double, 6, 6>& covariance) {
  return {std::sqrt(covariance.diagonal().head<3>().maxCoeff()), std::sqrt(covariance.diagonal().tail<3>().maxCoeff())};
}

std::string ImplausibleArmText(const RobotSummary& robot) {
  const std::vector<std::string> errors = robot.is_estimated ? ImplausibleErrors(robot) : std::vector<std::string>();
  return errors.empty() ? "" : "errors that no arm has: " + Join(errors, ", ");
}

std::string PoseText(const Rigid3d& pose, double sigma_mm, double sigma_rad) {
  constexpr int kMostDecimals = 8;
  constexpr int kFewestDecimals = 3;
  const double sign = pose.rotation.w() < 0 ? -1 : 1;
  std::vector<std::string> t;
  std::vector<std::string> q;
  for (int i = 0; i < 3; ++i) t.push_back(Fixed(1000 * pose.translation[i], DecimalsFor(sigma_mm, kMostDecimals)));
  const int decimals = std::max(kFewestDecimals, DecimalsFor(sigma_rad, kMostDecimals));
  for (int i = 0; i < 4; ++i) q.push_back(Fixed(sign * pose.rotation.coeffs()[i], decimals));
  return "[" + Join(t, ", ") + "] mm, quaternion xyzw [" + Join(q, ", ") + "]";
}

std::string FigureText(const std::optional<double>& value) { return value ? Significant(*value, 3) : "-"; }

std::string RobotNoiseText(const RobotNoise& noise, const std::optional<RobotNoise>& smooth_noise) {
  const auto sigmas = [](const RobotNoise& of) {
    return ShownNoise(1000 * of.translation_m) + " mm and " + ShownNoise(RadToDeg(of.rotation_rad)) + " deg";
  };
  std::string text = sigmas(noise);
  if (noise.joint_rad > 0) text += ", each joint " + ShownNoise(RadToDeg(noise.joint_rad)) + " deg";
  if (smooth_noise) text += ", smooth errors " + sigmas(*smooth_noise);
  return text;
}

std::string VerdictFailure(const Verdict& verdict) {
  const Finding& worst = verdict.findings.front();
  return "the verdict is " + std::string(GradeName(verdict.grade)) + " (--fail-on): " + worst.text +
         (worst.action.empty() ? "" : "; " + worst.action);
}

std::string CsvField(const std::string& text_in) {
  // A spreadsheet would take these for the beginning of a formula.
  const bool is_formula = !text_in.empty() && std::string_view("=+-@\t").find(text_in[0]) != std::string_view::npos;
  const std::string text = is_formula ? "'" + text_in : text_in;
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string FigureCell(const std::optional<double>& value, int digits, size_t width) {
  if (!value) return "-";
  constexpr double kRounding = 1e-9;
  if (std::abs(*value) < kRounding) return "0";
  std::string text = Significant(*value, digits);
  while (text.size() >= width && digits > 1) text = Significant(*value, --digits);
  if (text.size() < width) return text;
  char buffer[32];
  std::snprintf(buffer, sizeof(buffer), "%.0e", *value);
  return buffer;
}

std::string VerdictLines(const Verdict& verdict, Colour colour) {
  const std::string bold = colour == Colour::kAnsi ? "\x1b[1m" : "";
  const std::string plain = colour == Colour::kAnsi ? "\x1b[0m" : "";
  std::string lines = bold + "verdict: " + std::string(GradeName(verdict.grade)) + plain + "\n";
  for (const Finding& finding : verdict.findings) {
    if (finding.grade == Grade::kGood) continue;
    lines += "  " + std::string(GradeName(finding.grade)) + " [" + finding.code + "]: " + finding.text + "\n";
    if (!finding.action.empty()) lines += "    -> " + finding.action + "\n";
  }
  return lines;
}

}  // namespace heba
