#include "tools/pages/report_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <set>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/io/pose_formats.h"
#include "heba/io/result_file.h"
#include "heba/kernels/small_matrix.h"
#include "tools/pages/residual_sections.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

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

// Shows the figures that users need first: of several cameras those of the worst, which is named.
std::string TilesPart(const ReportData& data) {
  const RunResult& result = data.result;
  const Solution& solution = result.solution;
  std::string tiles;
  const auto add = [&](const std::string& name, const std::string& value) {
    tiles += "<div><dt>" + EscapedForMarkup(name) + "</dt><dd>" + EscapedForMarkup(value) + "</dd></div>\n";
  };
  const auto suffix = [](bool is_named, const std::string& name) { return is_named ? ", " + name : std::string(); };
  const auto add_worst = [&](const std::string& name, const std::string& unit, auto text, auto figure_of) {
    std::optional<double> worst;
    std::string of_camera;
    for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
      const std::optional<double> value = figure_of(c);
      if (!value || (worst && *value <= *worst)) continue;
      worst = value;
      of_camera = suffix(result.rig.cameras.size() > 1, result.rig.cameras[c].name);
    }
    if (worst) add(name + of_camera, text(*worst) + " " + unit);
  };
  const auto sigma_text = [](double value) { return ShownAmount(value, 3); };
  const auto error_text = [](double value) { return Significant(value, 3); };
  const auto sigmas_of = [&](size_t c) {
    const auto covariance = PoseCovarianceOf(solution.covariance, CameraPoseBlock(result.rig.cameras[c]));
    return covariance ? std::optional(LargestSigmas(*covariance)) : std::nullopt;
  };
  add_worst("camera position, one sigma (worst axis)", "mm", sigma_text, [&](size_t c) {
    const auto sigmas = sigmas_of(c);
    return sigmas ? std::optional(1000 * sigmas->first) : std::nullopt;
  });
  add_worst("camera orientation, one sigma (worst axis)", "deg", sigma_text, [&](size_t c) {
    const auto sigmas = sigmas_of(c);
    return sigmas ? std::optional(RadToDeg(sigmas->second)) : std::nullopt;
  });
  add_worst("target at its working point, one sigma (worst axis)", "mm", sigma_text, [&](size_t c) {
    const std::optional<WorkingPoint> point =
        c < result.working_points.size() ? result.working_points[c] : std::nullopt;
    return point ? std::optional(1000 * std::sqrt(point->covariance_m2.diagonal().maxCoeff())) : std::nullopt;
  });
  add_worst("hold-out error at the target", "mm", error_text,
            [&](size_t c) { return result.errors[c].holdout_target_mm; });
  add_worst("hold-out RMS", "px", error_text, [&](size_t c) { return result.errors[c].holdout_rms_px; });
  add_worst("pixel noise", "px", error_text, [&](size_t c) { return std::optional(solution.pixel_sigmas_px[c]); });
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    if (!solution.robot_noise[r]) continue;
    add("robot noise" + suffix(result.rig.robots.size() > 1, result.rig.robots[r]),
        RobotNoiseText(*solution.robot_noise[r], SmoothNoiseOf(solution, r)));
  }
  return "<dl class=\"tiles\">\n" + tiles + "</dl>\n";
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

std::string PosePart(const ShownPose& shown) {
  const Rigid3d& pose = shown.pose;
  const std::optional<Matrix6>& covariance = shown.covariance;
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
  return "<div>\n<h3><code>" + EscapedForMarkup(shown.name) + "</code></h3>\n" +
         HtmlTable({"", "value", "one sigma"}, rows) + Paragraph("4 x 4 matrix, translation in m:") +
         CopyableText(MatrixText(pose)) + Paragraph("x y z in m, quaternion x y z w:") +
         CopyableText(Fixed(pose.translation.x(), 9) + " " + Fixed(pose.translation.y(), 9) + " " +
                      Fixed(pose.translation.z(), 9) + " " + QuaternionText(pose)) +
         "</div>\n";
}

// Returns the table of one camera's intrinsics. `truth` may be null.
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

// Shows the cameras of a rig with their errors. Those of a single camera are in the table of its methods.
std::string CamerasPart(const ReportData& data) {
  if (IsShort(data.result)) return "";
  const RunResult& result = data.result;
  std::vector<FigureLine> rows;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const ProblemCamera& camera = result.rig.cameras[c];
    const auto [used, all] = CountImages(result, camera.name);
    rows.push_back({{{camera.name, false, {}, true},
                     {MountText(result.rig, camera)},
                     {std::to_string(used) + " of " + std::to_string(all), true}},
                    FiguresOf(result, c)});
  }
  return PageSection("Cameras", Paragraph("RMS reprojection errors with the poses of the arms as reported: on the "
                                          "captures of the estimate, and on captures that it has not seen.") +
                                    FiguresTable({"camera", "mount", "images used"},
                                                 {{"pixel noise, px", &CameraFigures::pixel_sigma_px}}, rows));
}

// Shows the result of a single camera; that of a rig is longer than a page, and has sections of its own.
std::string ResultPart(const ReportData& data) {
  if (!IsShort(data.result)) return "";
  return Heading("Result (" + FindFinal(data.result)->method + ")") +
         PoseParts(PosesOf(data.result), IntrinsicsTables(data));
}

// Quotes a text as one word of a shell command.
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

// Returns the arguments of heba locate: an image of each camera, and the pose of each arm that carries one.
std::string LocatedWith(const Problem& rig) {
  std::vector<std::string> arguments;
  std::vector<std::string> poses;
  for (const ProblemCamera& camera : rig.cameras) {
    arguments.push_back((camera.name.empty() ? "" : ShellWord(camera.name) + "=") + "IMAGE");
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const bool is_needed = std::any_of(rig.cameras.begin(), rig.cameras.end(), [&](const ProblemCamera& camera) {
      return camera.mount == Mount{r, Mount::Part::kGripper};
    });
    if (is_needed) poses.push_back(rig.robots.size() == 1 ? "NUMBERS" : rig.robots[r] + "=NUMBERS");
  }
  if (!poses.empty()) arguments.push_back("--pose " + ShellWord(Join(poses, ";")));
  return Join(arguments, " ");
}

// Returns the actions of the findings and the commands that use the result.
std::string NextPart(const ReportData& data, const ReportContext& context) {
  const Verdict& verdict = data.result.verdict;
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
  return data.has_images() ? part + CopyableText("heba locate " + run + " " + LocatedWith(data.result.rig)) : part;
}

// Returns what the calibration was made from.
std::vector<std::pair<std::string, std::string>> FactsOf(const ReportData& data) {
  const RunResult& result = data.result;
  std::vector<std::pair<std::string, std::string>> facts;
  if (IsShort(result)) {
    const Setup setup = SetupOf(result.rig.cameras[0].mount);
    const bool is_fixed = setup == Setup::kEyeToHand;
    facts.emplace_back("setup", std::string(SetupName(setup)) + (is_fixed ? ": the camera is fixed beside the robot"
                                                                          : ": the robot carries the camera"));
    facts.emplace_back("target",
                       result.target_types[0] + ", " + std::to_string(result.num_target_points[0]) + " points");
  } else {
    facts.emplace_back("cameras", std::to_string(result.rig.cameras.size()));
    for (size_t t = 0; t < result.rig.targets.size(); ++t) {
      facts.emplace_back("target " + result.rig.targets[t].name,
                         result.target_types[t] + ", " + std::to_string(data.target_points[t].cols()) + " points, on " +
                             MountText(result.rig, result.rig.targets[t]));
    }
  }
  facts.emplace_back("captures",
                     std::to_string(NumUsedCaptures(result)) + " of " + std::to_string(NumCaptures(result)) + " used");
  return facts;
}

// Returns the record of a run: facts, each with its name, the remarks of the config, and what the context states.
std::string RecordPart(const ReportData& data, const ReportContext& context) {
  std::vector<std::pair<std::string, std::string>> facts = FactsOf(data);
  const auto& about = data.result.about;
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

// Returns the markup of a verdict: the causes, then their symptoms, then the findings that are good, each finding once.
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

}  // namespace

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

std::vector<ShownPose> PosesOf(const RunResult& result) {
  const Problem& rig = result.rig;
  const CellPoses& poses = result.solution.poses;
  const Covariance& covariance = result.solution.covariance;
  std::vector<ShownPose> all;
  // A part without a name is called by its kind.
  const auto add = [&](const std::string& kind, const std::string& name, const std::string& parent, const Rigid3d& pose,
                       const std::string& block, const std::optional<PoseError>& truth) {
    all.push_back({kind + " " + name + " in " + parent, parent + "_from_" + (name.empty() ? kind : name), pose,
                   PoseCovarianceOf(covariance, block), truth});
  };
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const CameraErrors& errors = result.errors[c];
    const auto truth = errors.truth_mm ? std::optional(PoseError{*errors.truth_mm, *errors.truth_deg}) : std::nullopt;
    add("camera", rig.cameras[c].name, MountText(rig, rig.cameras[c]), poses.mount_from_camera[c],
        CameraPoseBlock(rig.cameras[c]), truth);
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    add("target", rig.targets[t].name, MountText(rig, rig.targets[t]), poses.mount_from_target[t],
        TargetPoseBlock(rig.targets[t]), ErrorAt(result.truth.targets, t));
  }
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    add("base of arm", rig.robots[r], "world", poses.world_from_base[r], BaseBlock(rig.robots[r]),
        ErrorAt(result.truth.bases, r));
  }
  return all;
}

std::string PoseParts(const std::vector<ShownPose>& poses, const std::string& intrinsics) {
  std::string parts;
  for (const ShownPose& pose : poses) parts += PosePart(pose);
  return "<div class=\"columns\">\n" + parts + intrinsics + "</div>\n" +
         Paragraph(
             "Roll, pitch and yaw are rotations about the fixed axes x, y and z, in this order. The camera has "
             "OpenCV's axes: x right, y down, z forward.");
}

std::string IntrinsicsTables(const ReportData& data) {
  const RunResult& result = data.result;
  std::string tables;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const ProblemCamera& camera = result.rig.cameras[c];
    if (result.solution.cameras[c].params.empty()) continue;
    const bool has_truth = !data.true_cameras.empty() && data.true_cameras[c];
    tables +=
        IntrinsicsTable(camera.name.empty() ? "Camera" : camera.name, result.solution.cameras[c],
                        result.solution.covariance, CameraBlock(camera), has_truth ? &*data.true_cameras[c] : nullptr);
  }
  return tables;
}

std::string TitleOf(const ReportData& data, const ReportContext& context) {
  const std::string folder = context.config.parent_path().filename().string();
  return data.result.name == "config" && !folder.empty() ? folder : data.result.name;
}

std::string RecordSection(const ReportData& data, const ReportContext& context, const std::string& beside) {
  const std::string verdict = VerdictPart(data.result.verdict) + (data.has_images() ? TilesPart(data) : "");
  return "<div class=\"record-page\">\n<h1>" + EscapedForMarkup(TitleOf(data, context)) + "</h1>\n" +
         (beside.empty() ? verdict
                         : "<div class=\"first\">\n<div>\n" + verdict + "</div>\n<div class=\"beside\">\n" + beside +
                               "</div>\n</div>\n") +
         CamerasPart(data) + ResultPart(data) + NextPart(data, context) + RecordPart(data, context) + "</div>\n";
}

}  // namespace heba
