#include "tools/doctor/doctor.h"

#include <algorithm>
#include <utility>

#include "heba/io/pose_formats.h"
#include "tools/doctor/checks.h"
#include "tools/run/time_offset.h"
#include "tools/text/finding_text.h"

namespace heba {

namespace {

struct Check {
  bool needs_images;
  Checked (*run)(const Examination& examination);
};
constexpr Check kChecks[] = {
#define HEBA_CHECK(name, needs_images, what) {needs_images, &Check_##name},
#include "tools/doctor/checks.def"
#undef HEBA_CHECK
};

// Returns the views of the data set.
std::vector<ExaminedView> ExaminedViewsOf(const Examination& examination) {
  const Dataset& data = examination.config.data;
  return data.target_poses.empty() ? ExamineViews(data, examination.detections, *examination.camera)
                                   : ViewsOfPoses(data);
}

// Returns the examination with its views, and with the poses of a robot's stream, if there is one, at the offset that
// they show.
Examination WithViews(Examination examination) {
  examination.views = ExaminedViewsOf(examination);
  RunConfig& config = examination.config;
  if (!config.data.stream || !config.options.estimates_time_offset) return examination;
  std::vector<SeenPose> seen;
  for (const ExaminedView& view : examination.views) seen.push_back({view.capture, view.camera_from_target.front()});
  const double offset_s = FindTimeOffset(config.data, {seen});
  config.data = WithPosesAt(std::move(config.data), offset_s);
  PosesFileOfArm& arm = config.arms.front();
  for (size_t i = 0; i < arm.numbers.size(); ++i) {
    arm.numbers[i] = NumbersFromPose(arm.reading.format, config.data.captures[i].base_from_gripper.front());
  }
  examination.views = ExaminedViewsOf(examination);
  return examination;
}

bool IsWrong(const Symptom& symptom) { return symptom.severity == Severity::kWrong; }

bool Has(const Diagnosis& diagnosis, SymptomCode code) {
  return std::any_of(diagnosis.symptoms.begin(), diagnosis.symptoms.end(),
                     [&](const Symptom& symptom) { return symptom.code == code; });
}

}  // namespace

int Diagnosis::NumWrong() const { return static_cast<int>(std::count_if(symptoms.begin(), symptoms.end(), IsWrong)); }

Diagnosis DiagnosePair(const RunConfig& config, int num_threads, Verbosity verbosity, Examine examine,
                       const CellContext& rig) {
  Examination examination;
  examination.config = config;
  examination.num_threads = num_threads;
  examination.verbosity = verbosity;
  examination.rig = rig;
  Diagnosis diagnosis;
  diagnosis.num_captures = static_cast<int>(config.data.captures.size());
  if (!config.data.target_poses.empty()) {
    examination = WithViews(std::move(examination));
    diagnosis.num_seen = diagnosis.num_captures;
  }
  for (const Check& check : kChecks) {
    if (check.needs_images && !config.data.target_poses.empty()) continue;
    if (examine == Examine::kInputs && check.run == &Check_result) continue;
    // The views are examined as soon as there is a camera.
    if (examination.camera && examination.views.empty()) {
      examination = WithViews(std::move(examination));
      diagnosis.num_seen = static_cast<int>(examination.views.size());
    }
    Checked checked = check.run(examination);
    for (Symptom& symptom : checked.symptoms) {
      // The run finds some of what the other checks have reported, such as few captures.
      if (check.run == &Check_result && Has(diagnosis, symptom.code)) continue;
      diagnosis.symptoms.push_back(std::move(symptom));
    }
    examination = Corrected(std::move(examination), std::move(checked));
    examination.found_wrong = diagnosis.NumWrong() > 0;
  }
  // A jump explains the poses.
  if (Has(diagnosis, "poses_jump")) {
    std::erase_if(diagnosis.symptoms,
                  [](const Symptom& symptom) { return symptom.code.name() == "poses_unexplained"; });
  }
  diagnosis.pose_fit = examination.pose_fit;
  diagnosis.symptoms = BySeverity(std::move(diagnosis.symptoms));
  return diagnosis;
}

Symptom SymptomOf(const Finding& finding) {
  Finding described = Described(finding);
  return {finding.grade == Grade::kBad ? Severity::kWrong : Severity::kRemark, SymptomCode::OfFinding(finding),
          std::move(described.text), std::move(described.action), FindingWords(finding).settings};
}

std::vector<Symptom> BySeverity(std::vector<Symptom> symptoms) {
  std::stable_partition(symptoms.begin(), symptoms.end(), IsWrong);
  return symptoms;
}

std::string FirstWrong(const Diagnosis& diagnosis) {
  if (diagnosis.NumWrong() == 0) return "";
  const Symptom& first = diagnosis.symptoms.front();
  return first.what + (first.cure.empty() ? "" : "; " + first.cure);
}

std::string WithDiagnosis(const std::string& reason, const Diagnosis& diagnosis) {
  if (diagnosis.NumWrong() == 0) return reason;
  const Symptom& first = diagnosis.symptoms.front();
  if (reason.find(first.what) != std::string::npos) return reason + (first.cure.empty() ? "" : "; " + first.cure);
  // Poses that the doctor cannot explain are no cause of the failure.
  const bool is_cause = !IsOfSingleCaptures(first) && first.code.name() != "poses_unexplained";
  if (!is_cause) return reason + "; heba doctor: " + first.what;
  return "heba doctor: " + FirstWrong(diagnosis);
}

std::vector<Finding> WithCause(const Diagnosis& diagnosis, std::vector<Finding> findings) {
  if (diagnosis.NumWrong() == 0) return findings;
  const Symptom& first = diagnosis.symptoms.front();
  // A fault of single captures does not make the whole bad.
  const bool is_of_all = !IsOfSingleCaptures(first);
  Finding cause{is_of_all ? Grade::kBad : Grade::kDoubtful, std::string(first.code.name())};
  cause.is_cause = true;
  cause.text = first.Text();
  cause.action = first.cure;
  std::erase_if(findings, [&](const Finding& finding) { return finding.code == cause.code; });
  // A fault of all captures has as a consequence whatever the run took for a cause.
  for (const Finding& finding : findings) {
    if (finding.is_cause && is_of_all) cause.parts.push_back(finding);
  }
  std::erase_if(findings, [&](const Finding& finding) { return finding.is_cause && is_of_all; });
  findings.insert(findings.begin(), std::move(cause));
  return findings;
}

}  // namespace heba
