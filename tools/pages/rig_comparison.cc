#include "tools/pages/rig_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/pages/page.h"
#include "tools/pages/static_chart.h"
#include "tools/text/difference_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

void SetSigmas(const Eigen::Matrix<double, 6, 6>& covariance, CellCamera* camera) {
  camera->sigma_mm = 1000 * std::sqrt(covariance.diagonal().head<3>().sum());
  camera->sigma_deg = RadToDeg(std::sqrt(covariance.diagonal().tail<3>().sum()));
}

// Returns a pose of a run; nothing if it has none of this name. The pose of camera a in b is that of b in a, inverted.
std::optional<UncertainPose> FindPose(const ComparedCell& run, const CellPoseName& name) {
  for (const CellPose& pose : run.poses) {
    if (pose.name == name) return pose.parent_from_child;
    if (name.kind != CellPoseKind::kCameraInCamera) continue;
    if (!(pose.name == CellPoseName{name.kind, name.child, name.parent})) continue;
    const UncertainPose& inverse = pose.parent_from_child;
    const Eigen::Matrix<double, 6, 6> adjoint = Adjoint(inverse.pose);
    return UncertainPose{Inverse(inverse.pose), adjoint * inverse.covariance * adjoint.transpose(),
                         inverse.covariance_dof};
  }
  return std::nullopt;
}

std::vector<CellDifference> DifferencesOf(const std::vector<ComparedCell>& runs, size_t first, size_t second) {
  std::vector<CellDifference> differences;
  for (const CellPose& pose : runs[first].poses) {
    const std::optional<UncertainPose> other = FindPose(runs[second], pose.name);
    if (!other) continue;
    const std::optional<PoseDifference> difference = DifferenceOf(pose.parent_from_child, *other);
    if (difference) differences.push_back({*difference, first, second, pose.name});
  }
  return differences;
}

// Throws InputError if the runs cannot be compared.
void CheckRuns(const RigComparison& comparison) {
  const auto several = std::find_if(comparison.runs.begin(), comparison.runs.end(),
                                    [](const ComparedCell& run) { return run.arms.size() > 1; });
  for (const ComparedCell& run : comparison.runs) {
    if (several == comparison.runs.end() || (!run.arms.empty() && run.arms.front() == several->arms.front())) continue;
    throw InputError(run.label + ": its world is the base of " +
                     (run.arms.empty() ? "an arm without a name" : "arm " + run.arms.front()) + ", but that of " +
                     several->label + " is the base of arm " + several->arms.front() +
                     "; runs are compared that name the same arm first");
  }
  if (comparison.runs.size() < 2) return;
  std::vector<const ComparedCell*> without;
  for (size_t i = 0; i < comparison.runs.size(); ++i) {
    const bool is_compared =
        std::any_of(comparison.differences.begin(), comparison.differences.end(),
                    [&](const CellDifference& difference) { return difference.first == i || difference.second == i; });
    if (!is_compared) without.push_back(&comparison.runs[i]);
  }
  // The run of one camera is named first, because it may have left a rig without another run.
  for (const ComparedCell* run : without) {
    if (!run->arms.empty()) continue;
    throw InputError(run->label + ": is the run of one camera; a rig beside it needs a " +
                     run->poses.front().name.Text() + ", which it is compared with");
  }
  if (without.empty()) return;
  throw InputError(without.front()->label +
                   ": has no camera, target or arm of the same name and mount as one of another run, by which rigs are "
                   "compared");
}

// Names the cameras, targets and arms that some rigs lack.
std::string MissingFinding(const std::vector<ComparedCell>& runs) {
  std::vector<std::string> parts;
  std::vector<CellPoseName> known;
  for (const ComparedCell& run : runs) {
    for (const CellPose& pose : run.poses) {
      // A pose between cameras is missing because one of the cameras is.
      if (pose.name.kind == CellPoseKind::kCameraInCamera) continue;
      if (std::find(known.begin(), known.end(), pose.name) != known.end()) continue;
      known.push_back(pose.name);
      std::vector<std::string> without;
      for (const ComparedCell& other : runs) {
        if (!other.arms.empty() && !FindPose(other, pose.name)) without.push_back(other.label);
      }
      if (!without.empty()) parts.push_back(pose.name.Text() + " (not in " + Join(without, ", ") + ")");
    }
  }
  return parts.empty() ? "" : "not in all rigs: " + Join(parts, ", ");
}

std::vector<std::string> FindingsOf(const RigComparison& comparison) {
  constexpr std::array<const char*, 4> kPlurals = {"poses of cameras", "poses between cameras", "poses of targets",
                                                   "poses of arms"};
  std::vector<std::string> findings;
  for (size_t kind = 0; kind < kPlurals.size(); ++kind) {
    std::vector<NamedDifference> differences;
    for (const CellDifference& difference : comparison.differences) {
      if (static_cast<size_t>(difference.name.kind) != kind) continue;
      differences.push_back({difference.name.Text() + ": " + comparison.runs[difference.first].label + " and " +
                                 comparison.runs[difference.second].label,
                             difference});
    }
    findings.push_back(AgreementFinding(kPlurals[kind], differences));
  }
  findings.push_back(MissingFinding(comparison.runs));
  std::erase(findings, "");
  return findings;
}

std::string Exact(const std::optional<double>& value) { return value ? RoundTrip(*value) : std::string(); }

constexpr size_t kRunWidth = 20;
constexpr size_t kCameraWidth = 15;

std::string CamerasTable(const RigComparison& comparison) {
  std::string table = PadRight("run", kRunWidth) + " " + PadRight("camera", kCameraWidth) + PadLeft("in-sample", 10) +
                      PadLeft("hold-out", 9) + PadLeft("hold-out", 9) + PadLeft("sigma", 8) + PadLeft("sigma", 8) +
                      "\n" + PadRight("", kRunWidth + 1 + kCameraWidth) + PadLeft("px rms", 10) + PadLeft("px rms", 9) +
                      PadLeft("mm rms", 9) + PadLeft("mm", 8) + PadLeft("deg", 8) + "\n";
  for (const ComparedCell& run : comparison.runs) {
    for (const CellCamera& camera : run.cameras) {
      table += PadRight(ShortenedAtStart(run.label, kRunWidth), kRunWidth) + " " +
               PadRight(ShortenedAtStart(camera.name, kCameraWidth), kCameraWidth) +
               PadLeft(FigureCell(camera.reprojection_rms_px, 3, 10), 10) +
               PadLeft(FigureCell(camera.holdout_rms_px, 3, 9), 9) +
               PadLeft(FigureCell(camera.holdout_target_mm, 3, 9), 9) + PadLeft(FigureCell(camera.sigma_mm, 3, 8), 8) +
               PadLeft(FigureCell(camera.sigma_deg, 3, 8), 8) + "\n";
    }
  }
  return table;
}

// Returns a table of the differences of each pair of runs, the pair with the least likely difference first.
std::string DifferencesTable(const RigComparison& comparison) {
  using Pair = std::pair<size_t, size_t>;
  std::map<Pair, double> least_p_value;
  for (const CellDifference& difference : comparison.differences) {
    const auto [entry, is_new] = least_p_value.emplace(Pair(difference.first, difference.second), difference.p_value);
    if (!is_new) entry->second = std::min(entry->second, difference.p_value);
  }
  std::vector<Pair> pairs;
  for (const auto& [pair, p_value] : least_p_value) pairs.push_back(pair);
  std::stable_sort(pairs.begin(), pairs.end(),
                   [&](const Pair& a, const Pair& b) { return least_p_value.at(a) < least_p_value.at(b); });
  constexpr size_t kMostPairs = 3;
  constexpr size_t kNameWidth = 36;
  std::string table;
  for (size_t i = 0; i < std::min(pairs.size(), kMostPairs); ++i) {
    const auto& [first, second] = pairs[i];
    table += "\n" + comparison.runs[first].label + " and " + comparison.runs[second].label + "\n" +
             PadRight("  difference", kNameWidth) + PadLeft("mm", 8) + PadLeft("sigma", 7) + PadLeft("deg", 8) +
             PadLeft("sigma", 7) + PadLeft("chance", 7) + "\n";
    for (const CellDifference& difference : comparison.differences) {
      if (Pair(difference.first, difference.second) != pairs[i]) continue;
      table += PadRight("  " + ShortenedAtStart(difference.name.Text(), kNameWidth - 2), kNameWidth) +
               PadLeft(FigureCell(difference.distance_mm, 2, 8), 8) +
               PadLeft(FigureCell(difference.sigma_mm, 2, 7), 7) + PadLeft(FigureCell(difference.angle_deg, 2, 8), 8) +
               PadLeft(FigureCell(difference.sigma_deg, 2, 7), 7) + PadLeft(ShownPValue(difference.p_value), 7) + " " +
               Agreement(difference) + "\n";
    }
  }
  if (pairs.size() > kMostPairs) table += "and " + std::to_string(pairs.size() - kMostPairs) + " more pairs of runs\n";
  return table;
}

}  // namespace

std::string CellPoseName::Text() const {
  switch (kind) {
    case CellPoseKind::kCamera:
      return "camera " + child + " in " + parent;
    case CellPoseKind::kCameraInCamera:
      return "camera " + child + " in camera " + parent;
    case CellPoseKind::kTarget:
      return "target " + child + " in " + parent;
    case CellPoseKind::kArm:
      break;
  }
  return "base of arm " + child + " in " + parent;
}

ComparedCell CellOf(const std::string& label, const RigResult& result) {
  ComparedCell cell;
  cell.label = label;
  cell.grade = result.verdict.grade;
  cell.seconds = result.timing.total_s;
  cell.arms = result.rig.robots;
  const std::vector<RelativePose> cameras = CameraPoses(result.rig, result.solution);
  for (size_t c = 0; c < cameras.size(); ++c) {
    const RigErrors& errors = result.errors[c];
    CellCamera camera{cameras[c].child, errors.reprojection_rms_px, errors.holdout_rms_px, errors.holdout_target_mm,
                      errors.holdout_target_deg};
    SetSigmas(cameras[c].covariance, &camera);
    cell.cameras.push_back(std::move(camera));
  }
  const std::pair<CellPoseKind, std::vector<RelativePose>> groups[] = {
      {CellPoseKind::kCamera, cameras},
      {CellPoseKind::kCameraInCamera, result.relative_cameras},
      {CellPoseKind::kTarget, TargetPoses(result.rig, result.solution)},
      {CellPoseKind::kArm, BasePoses(result.rig, result.solution)}};
  for (const auto& [kind, poses] : groups) {
    for (const RelativePose& pose : poses) {
      cell.poses.push_back(
          {{kind, pose.parent, pose.child}, {pose.parent_from_child, pose.covariance, result.solution.covariance_dof}});
    }
  }
  return cell;
}

ComparedCell CellOf(const std::string& label, const RunResult& result) {
  const Estimate* const refined = FindRefined(result);
  if (refined == nullptr) throw InputError(label + ": has no refined estimate, which is compared with rigs");
  const Solution& solution = *refined->solution;
  const Eigen::Matrix<double, 6, 6> covariance = solution.covariance.matrix.topLeftCorner<6, 6>();
  ComparedCell cell;
  cell.label = label;
  cell.grade = result.verdict.grade;
  cell.seconds = result.timing.total_s;
  const Errors& errors = refined->errors;
  CellCamera camera{result.name, errors.reprojection_rms_px, errors.holdout_rms_px, errors.holdout_target_mm,
                    errors.holdout_target_deg};
  SetSigmas(covariance, &camera);
  cell.cameras.push_back(std::move(camera));
  cell.poses.push_back({{CellPoseKind::kCamera, result.setup == Setup::kEyeToHand ? "world" : "gripper", result.name},
                        {refined->hand_eye.camera_mount_from_camera, covariance, solution.covariance_dof}});
  return cell;
}

RigComparison CompareRigs(std::vector<ComparedCell> runs) {
  RigComparison comparison;
  comparison.runs = std::move(runs);
  for (size_t first = 0; first < comparison.runs.size(); ++first) {
    for (size_t second = first + 1; second < comparison.runs.size(); ++second) {
      for (CellDifference& difference : DifferencesOf(comparison.runs, first, second)) {
        comparison.differences.push_back(std::move(difference));
      }
    }
  }
  CheckRuns(comparison);
  comparison.findings = FindingsOf(comparison);
  return comparison;
}

std::string RigComparisonTable(const RigComparison& comparison) {
  std::string table = CamerasTable(comparison) + DifferencesTable(comparison) + "\n" +
                      "sigma is that of the whole position or orientation: the root of the sum of the variances of the "
                      "three axes\n";
  for (const std::string& finding : comparison.findings) table += "- " + finding + "\n";
  return table;
}

std::string RigComparisonRunsCsv(const RigComparison& comparison) {
  std::string csv =
      "run,camera,verdict,reprojection_rms_px,holdout_rms_px,holdout_target_mm,holdout_target_deg,std_translation_mm,"
      "std_rotation_deg,seconds\n";
  for (const ComparedCell& run : comparison.runs) {
    for (const CellCamera& camera : run.cameras) {
      csv += CsvField(run.label) + "," + CsvField(camera.name) + "," + std::string(GradeName(run.grade)) + "," +
             Exact(camera.reprojection_rms_px) + "," + Exact(camera.holdout_rms_px) + "," +
             Exact(camera.holdout_target_mm) + "," + Exact(camera.holdout_target_deg) + "," +
             RoundTrip(camera.sigma_mm) + "," + RoundTrip(camera.sigma_deg) + "," + RoundTrip(run.seconds) + "\n";
    }
  }
  return csv;
}

std::string RigComparisonPairsCsv(const RigComparison& comparison) {
  std::string csv = "first,second,kind,parent,child,distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n";
  for (const CellDifference& difference : comparison.differences) {
    csv += CsvField(comparison.runs[difference.first].label) + "," +
           CsvField(comparison.runs[difference.second].label) + "," +
           std::string(kCellPoseKindNames[static_cast<size_t>(difference.name.kind)]) + "," +
           CsvField(difference.name.parent) + "," + CsvField(difference.name.child) + "," +
           RoundTrip(difference.distance_mm) + "," + RoundTrip(difference.angle_deg) + "," +
           RoundTrip(difference.sigma_mm) + "," + RoundTrip(difference.sigma_deg) + "," +
           RoundTrip(difference.p_value) + "," + Agreement(difference) + "\n";
  }
  return csv;
}

std::string RigComparisonPage(const RigComparison& comparison) {
  using Json = nlohmann::ordered_json;
  std::string body = "<h1>Comparison of " + std::to_string(comparison.runs.size()) + " runs</h1>\n<ul>\n";
  for (const std::string& finding : comparison.findings) {
    body += "<li>" + EscapedForMarkup(Capitalised(finding)) + "</li>\n";
  }
  body += "</ul>\n" + Heading("Cameras");
  Json bars = Json::array();
  std::vector<FigureRow> charted;
  std::vector<std::vector<PageCell>> rows;
  for (const ComparedCell& run : comparison.runs) {
    for (const CellCamera& camera : run.cameras) {
      const std::string label = run.label + ", " + camera.name;
      charted.push_back({label, camera.holdout_rms_px, camera.reprojection_rms_px});
      bars.push_back(
          Json{{"label", label}, {"values", {OrNull(camera.holdout_rms_px), OrNull(camera.reprojection_rms_px)}}});
      rows.push_back({{run.label},
                      {camera.name},
                      {std::string(GradeName(run.grade))},
                      {FigureText(camera.reprojection_rms_px), true},
                      {FigureText(camera.holdout_rms_px), true},
                      {FigureText(camera.holdout_target_mm), true},
                      {FigureText(camera.holdout_target_deg), true},
                      {FigureText(camera.sigma_mm), true},
                      {FigureText(camera.sigma_deg), true},
                      {Significant(run.seconds, 3), true}});
    }
  }
  body += ViewFigure(
      "dumbbells", "RMS reprojection error of each camera, with the poses of the arm as it reports them.",
      Json{{"unit", "px"}, {"series", {"held-out captures", "captures of the estimate"}}, {"rows", bars}},
      DumbbellChart("RMS in px: held-out captures (first colour), captures of the estimate (second)", charted));
  body += Paragraph(
      "Sigma is that of the whole position or orientation of the camera: the root of the sum of the variances of the "
      "three axes. That of "
      "the least certain axis, which heba run states, is smaller.");
  body += HtmlTable({"run", "camera", "verdict of the run", "in-sample, px", "hold-out, px", "hold-out, mm",
                     "hold-out, deg", "sigma, mm", "sigma, deg", "time of the run, s"},
                    rows);
  body += Heading("Differences between poses");
  body += Paragraph(
      "Sigma is that of the difference, from both runs, of the whole position or orientation: the root of the sum of "
      "the variances of the three axes. The chance is the probability of a difference at least as "
      "large "
      "between runs that measure the same pose and share no captures; below 1 % the poses are said to differ.");
  rows.clear();
  for (const CellDifference& difference : comparison.differences) {
    rows.push_back({{difference.name.Text()},
                    {comparison.runs[difference.first].label},
                    {comparison.runs[difference.second].label},
                    {Significant(difference.distance_mm, 3), true},
                    {Significant(difference.sigma_mm, 3), true},
                    {Significant(difference.angle_deg, 3), true},
                    {Significant(difference.sigma_deg, 3), true},
                    {ShownPValue(difference.p_value), true},
                    {Agreement(difference)}});
  }
  body += HtmlTable({"pose", "run", "other run", "mm", "sigma, mm", "deg", "sigma, deg", "chance", ""}, rows);
  return HtmlPage("Comparison of runs", body, PageWidth::kWide);
}

}  // namespace heba
