// Checks whether joints and poses are those of the arm that the config names.
//
// Recorded joints and poses imply the tool of each capture, which is the same in all captures if they belong together.
// Without joints, an arm must reach all poses; among the arms and tools that do, the captures distinguish by the errors
// that they would need to have (solvers/calibration/model_choice.h, FitEffects).
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/base/even_indices.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/recorded_joints.h"
#include "tools/doctor/recovered_joints.h"
#include "tools/doctor/symptom.h"
#include "tools/run/captures.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// The distance at which a rotation counts as a translation.
constexpr double kLeverM = 0.5;

// Returns a figure with two digits; figures below a thousandth are rounding errors.
std::string Figure(double value) { return value < 1e-3 ? "less than 0.001" : Significant(value, 2); }
std::string MmAndDeg(double translation_m, double rotation_rad) {
  return Figure(1000 * translation_m) + " mm and " + Figure(RadToDeg(rotation_rad)) + " deg";
}
std::string ScatterText(const ImpliedTool& tool) { return MmAndDeg(tool.scatter_m, tool.scatter_rad); }

std::vector<Symptom> SingularSymptoms(const Dataset& data, const ArmBranch& branch, bool is_recorded) {
  const std::vector<SingularCapture> singular = SingularCaptures(data.arms.front()->arm, branch);
  if (singular.empty()) return {};
  std::vector<std::string> names;
  for (const SingularCapture& one : singular) {
    names.push_back(data.captures[one.capture].name + ": " + one.singularity);
  }
  return {{Severity::kRemark, "singular_captures",
           "the arm " + data.arms.front()->arm.name + " is at or close to a singularity in " +
               std::to_string(singular.size()) + " of " + std::to_string(data.captures.size()) + " captures (" +
               Join(names, "; ") + ")",
           is_recorded ? "nothing needs to be done: the joints are recorded"
                       : "record the joints (captures.joints), because those that are recovered from these poses are "
                         "uncertain, or move these captures away from the singularity"}};
}

// The limits of the comparison of joints and poses.
struct ComparisonLimits {
  // A misfit beyond this is more than that of most controllers' calibrations, so that another reading is looked for.
  double misfit_m = 5e-3;
  double better = 3;        // A reading whose misfit is smaller by this factor is the right one.
  double alike_m = 0.5e-3;  // Misfits below this are equally good: a controller's calibration has as much.
  // The scatter of a tool that rounding explains. Files state positions to 0.01 mm and angles to 0.001 deg or better,
  // whose rounding errors are a third of that, and those of six joints at a distance of 1 m add up to 20 um; a factory
  // calibration differs from the nominal kinematics by some tenths of a millimetre at least.
  double rounding_m = 20e-6;
  double rounding_deg = 0.005;
  // A tool that differs from robot.tool by less is the same one.
  double tool_m = 1e-3;
  double tool_deg = 0.1;
};
constexpr ComparisonLimits kComparisonLimits;

SymptomCode CodeOf(JointReading::Mistake mistake) {
  switch (mistake) {
    case JointReading::Mistake::kAngle:
      return "joint_angle";
    case JointReading::Mistake::kBase:
      return "robot_base";
    case JointReading::Mistake::kArm:
      return "robot_model";
    case JointReading::Mistake::kPairing:
      return "joint_pairing";
    case JointReading::Mistake::kNone:
      break;
  }
  return "joints_unexplained";
}

ConfigSetting ModelSetting(const Arm& arm) { return {"robot.model", arm.name}; }

// The words of a mistake.
struct MistakeWords {
  std::string condition;  // Under which joints and poses agree.
  std::string cure;
  std::vector<ConfigSetting> settings = {};
};

MistakeWords WithSetting(std::string condition, const ConfigSetting& setting) {
  return {std::move(condition), "set " + SettingsText({setting}), {setting}};
}

MistakeWords WordsOf(JointReading::Mistake mistake, const JointReading& reading, bool are_read_as_deg) {
  const std::string unit = are_read_as_deg ? "rad" : "deg";
  switch (mistake) {
    case JointReading::Mistake::kAngle:
      return WithSetting("if the joints are in " + unit, {"captures.joint_angle", unit});
    case JointReading::Mistake::kArm:
      return WithSetting("if they are those of the arm " + reading.arm.name, ModelSetting(reading.arm));
    case JointReading::Mistake::kPairing:
      return {"if " + reading.pairing, "correct the order of the file of joints, or give it a column image"};
    case JointReading::Mistake::kBase:
      break;
    case JointReading::Mistake::kNone:
      return {};
  }
  constexpr double kSameRad = 1e-3;
  constexpr double kSameM = 1e-3;
  const Rigid3d& base = reading.arm_base_from_base;
  const bool is_half_turn = base.translation.norm() < kSameM &&
                            std::abs(RotationAngle(base.rotation) - kPi) < kSameRad &&
                            std::abs(std::abs(base.rotation.z()) - 1) < kSameRad;
  if (is_half_turn) {
    return {"if the poses are stated in a base that is rotated by 180 deg about z against that of the arm",
            "rotate the poses by 180 deg about the z axis of the base (on a Universal Robots controller, base and ROS' "
            "base_link differ by this), or record them in the arm's base"};
  }
  return {"if the poses are stated in another base, which lies in that of the arm at " + PoseText(base),
          "record the poses in the arm's base, or multiply them by that pose from the left"};
}

// Returns the reading that explains joints and poses; null if none is decidedly better than the config's.
const JointReading* BestReading(const std::vector<JointReading>& readings, const ImpliedTool& now) {
  const JointReading* best = nullptr;
  const auto rank = [](const JointReading& reading) {
    return std::pair(reading.mistakes.size(), std::max(reading.tool.misfit_m, kComparisonLimits.alike_m));
  };
  double least_m = std::numeric_limits<double>::infinity();
  for (const JointReading& reading : readings) least_m = std::min(least_m, reading.tool.misfit_m);
  if (!(kComparisonLimits.better * least_m < now.misfit_m) || least_m > kComparisonLimits.misfit_m) return nullptr;
  for (const JointReading& reading : readings) {
    const bool is_alike = reading.tool.misfit_m <= std::max(2 * least_m, kComparisonLimits.alike_m);
    if (is_alike && (best == nullptr || rank(reading) < rank(*best))) best = &reading;
  }
  return best;
}

Symptom UnexplainedJoints(const Arm& arm, const ImpliedTool& now) {
  return {Severity::kWrong, "joints_unexplained",
          "the recorded joints and the poses do not belong together: with the dimensions of the arm " + arm.name +
              ", the tool scatters by " + ScatterText(now) +
              " (7 of 10 captures by less), and no other arm, base, unit or order that was tried explains it",
          "check robot.model, captures.joint_angle, and that the joints were recorded with the poses"};
}

Symptom WrongJoints(const JointReading& best, const Arm& arm, const ImpliedTool& now, bool are_read_as_deg) {
  std::vector<std::string> conditions;
  std::vector<std::string> cures;
  std::vector<ConfigSetting> settings;
  bool are_complete = true;  // Settings that are only a part of the cure would look like all of it.
  for (const JointReading::Mistake mistake : best.mistakes) {
    MistakeWords words = WordsOf(mistake, best, are_read_as_deg);
    conditions.push_back(std::move(words.condition));
    cures.push_back(std::move(words.cure));
    are_complete = are_complete && !words.settings.empty();
    settings.insert(settings.end(), words.settings.begin(), words.settings.end());
  }
  if (!are_complete) settings.clear();
  return {
      Severity::kWrong, CodeOf(best.mistakes.front()),
      "the recorded joints and the poses do not belong together as the config says: with the dimensions of the arm " +
          arm.name + ", the tool scatters by " + ScatterText(now) + " (7 of 10 captures by less), but only by " +
          ScatterText(best.tool) + " " + Join(conditions, " and "),
      Join(cures, "; "), std::move(settings)};
}

// Returns the step to which all turning joints are rounded, rad: the largest power of ten in the unit of their file; 0
// if they are not rounded.
double RoundingRad(const Arm& arm, const std::vector<Eigen::VectorXd>& joints, bool are_deg) {
  const auto is_rounded_to = [&](double step_rad) {
    for (const Eigen::VectorXd& of_capture : joints) {
      for (Eigen::Index j = 0; j < of_capture.size(); ++j) {
        const double steps = of_capture[j] / step_rad;
        if (arm.joints[static_cast<size_t>(j)].is_turning && std::abs(steps - std::round(steps)) > 1e-4) return false;
      }
    }
    return true;
  };
  for (const double step : {0.1, 0.01, 1e-3, 1e-4, 1e-5}) {
    const double step_rad = are_deg ? DegToRad(step) : step;
    if (is_rounded_to(step_rad)) return step_rad;
  }
  return 0;
}

// Remarks on the tool and on the kinematics of the controller, if joints and poses belong together. `rounding_rad`: the
// step to which the joints are rounded.
std::vector<Symptom> JointRemarks(const RobotArm& robot, const ImpliedTool& tool, double rounding_rad) {
  std::vector<Symptom> symptoms;
  const double apart_m = DistanceM(tool.tip_from_gripper, robot.tip_from_gripper);
  const double apart_rad = AngleRad(tool.tip_from_gripper, robot.tip_from_gripper);
  if (apart_m > std::max(kComparisonLimits.tool_m, 3 * tool.scatter_m) ||
      apart_rad > std::max(DegToRad(kComparisonLimits.tool_deg), 3 * tool.scatter_rad)) {
    symptoms.push_back({Severity::kRemark, "robot_tool",
                        "joints and poses say that the poses are those of a tool at " +
                            PoseText(tool.tip_from_gripper) + " from the tip of the arm " + robot.arm.name + ", " +
                            MmAndDeg(apart_m, apart_rad) + " from where robot.tool has it",
                        "nothing needs to be done, because the recorded joints determine the tool; state it as "
                        "robot.tool if the poses are to be used without the joints"});
  }
  // The rounding errors of the joints, of half a step each, at a distance of 1 m.
  const double by_rounding = 0.5 * rounding_rad * std::sqrt(robot.arm.num_joints());
  if (tool.scatter_m < kComparisonLimits.rounding_m + by_rounding &&
      tool.scatter_rad < DegToRad(kComparisonLimits.rounding_deg) + by_rounding) {
    symptoms.push_back({Severity::kRemark, "nominal_kinematics",
                        "the poses are the kinematics of the config for the recorded joints, to within " +
                            ScatterText(tool) + ": the controller computes them with the same dimensions of the arm " +
                            robot.arm.name + ", so that all errors of this very arm are in them",
                        "estimate the errors of the arm (refine.kinematics: auto, with 12 to 20 varied captures), or "
                        "let the controller use the factory calibration of this arm"});
  } else {
    symptoms.push_back(
        {Severity::kRemark, "calibrated_kinematics",
         "the poses differ from the kinematics of the config for the recorded joints by " + ScatterText(tool) +
             " (7 of 10 captures by less), which is more than rounding and less than another arm: the controller "
             "uses a calibration of its own, or joints and poses were recorded at different moments",
         "if the controller's calibration can be read out, enter it as robot.kinematics"});
  }
  return symptoms;
}

// Reports captures whose joints contradict their poses, where those of the others do not.
std::optional<Symptom> ContradictingJointsSymptom(const Dataset& data) {
  const std::vector<ContradictingJoints> wrong = FindContradictingJoints(data, 0);
  if (wrong.empty()) return std::nullopt;
  Symptom symptom{Severity::kWrong, "joint_pairing", "", ""};
  std::vector<std::string> texts;
  constexpr size_t kMostListed = 5;
  for (const ContradictingJoints& joints : wrong) {
    symptom.captures.push_back(data.captures[joints.capture].name);
    if (texts.size() == kMostListed) continue;
    texts.push_back(symptom.captures.back() + " (" + MmAndDeg(joints.apart_m, joints.apart_rad) + ")");
  }
  if (wrong.size() > kMostListed) texts.push_back("and " + std::to_string(wrong.size() - kMostListed) + " more");
  symptom.what = "the recorded joints and the pose do not belong together in " + std::to_string(wrong.size()) + " of " +
                 std::to_string(data.captures.size()) +
                 " captures, where the joints put the tool elsewhere: " + Join(texts, ", ");
  symptom.cure = "correct the joints or the poses of these captures, or leave them out (captures.exclude)";
  return symptom;
}

std::vector<Symptom> ExamineRecorded(const Examination& examination) {
  const Dataset& data = examination.config.data;
  const RobotArm& robot = *data.arms.front();
  constexpr size_t kFewest = 4;
  if (data.captures.size() < kFewest) return {};
  std::vector<Eigen::VectorXd> joints;
  std::vector<Rigid3d> poses;
  for (const Recording& capture : data.captures) {
    joints.emplace_back(Eigen::Map<const Eigen::VectorXd>(capture.joints.front().data(), robot.arm.num_joints()));
    poses.push_back(capture.base_from_gripper.front());
  }
  const ImpliedTool now = ImpliedToolOf(robot.arm, joints, poses);
  if (now.misfit_m > kComparisonLimits.misfit_m) {
    const std::vector<JointReading> readings = OtherReadings(robot.arm, Arms(), joints, poses);
    const JointReading* best = BestReading(readings, now);
    if (best != nullptr) return {WrongJoints(*best, robot.arm, now, examination.config.arms.front().joints_are_deg)};
    if (now.scatter_m > kMostToolScatterM || now.scatter_rad > DegToRad(kMostToolScatterDeg)) {
      return {UnexplainedJoints(robot.arm, now)};
    }
  }
  std::vector<Symptom> symptoms =
      JointRemarks(robot, now, RoundingRad(robot.arm, joints, examination.config.arms.front().joints_are_deg));
  for (Symptom& symptom : SingularSymptoms(data, {"recorded", joints}, true)) symptoms.push_back(std::move(symptom));
  if (std::optional<Symptom> wrong = ContradictingJointsSymptom(data)) {
    symptoms.insert(symptoms.begin(), std::move(*wrong));
  }
  return symptoms;
}

// The limits of the comparison of arms and tools by the captures.
struct LikelihoodLimits {
  double log_likelihood = 10;  // A reading whose log-likelihood is higher by less is not decidedly better.
  // Nor is one that leaves more than this share of the noise of the poses. If it leaves less than the second share, the
  // config is wrong. Otherwise, the error does little harm, or the arm has errors that are not modelled.
  double noise = 0.9;
  double noise_if_wrong = 0.7;
  double unlikely = 15;  // A configuration whose log-likelihood is lower by as much is not that of the captures.
};
constexpr LikelihoodLimits kLikelihoodLimits;

// The steps in which tools and bases are tried, and the step in which tools are compared by the captures.
constexpr double kComparedToolStepM = 0.1;
constexpr double kToolStepM = 0.05;
constexpr double kBaseStepM = 0.05;

// The calibration of the images without the arm, in which arms and tools are compared.
struct WithoutArm {
  PairCalibration calibration;
  PairCalibrationOptions options;
};

std::optional<WithoutArm> CalibrateWithoutArm(const Examination& examination) {
  const RunConfig& config = examination.config;
  if (!config.data.target_poses.empty() || examination.detections.empty()) return std::nullopt;
  if (config.options.kinematics == Kinematics::kNone) return std::nullopt;
  Dataset data = config.data;
  data.arms = {std::nullopt};
  if (data.has_camera.front() && examination.camera) data.rig.cameras.front().camera = *examination.camera;
  RunOptions run = config.options;
  run.num_threads = examination.num_threads;
  const CaptureDetection& first = examination.detections.front().detection;
  data.rig.cameras.front().camera.width_px = first.width_px;
  data.rig.cameras.front().camera.height_px = first.height_px;
  PairCalibrationOptions options = OptionsOf(data, run);
  Outcome<PairCalibration> calibration = CalibratePair(ViewsOf(data, examination.detections), options);
  if (!calibration || !calibration->refined) return std::nullopt;
  return WithoutArm{std::move(*calibration), std::move(options)};
}

bool IsAtFlange(const ArmReading& reading) {
  const Rigid3d& tool = reading.tip_from_gripper;
  return tool.translation.norm() < kComparisonLimits.tool_m &&
         RotationAngle(tool.rotation) < DegToRad(kComparisonLimits.tool_deg);
}

// Returns the tools to compare: along the flange's z axis before that of the config, or without that.
std::vector<ArmReading> ToolReadings(const ArmReading& stated, double step_m) {
  std::vector<ArmReading> readings = OtherTools(stated, step_m);
  if (IsAtFlange(stated)) return readings;
  ArmReading without = stated;
  without.mistake = ArmReading::Mistake::kTool;
  without.tip_from_gripper = Rigid3d();
  readings.push_back(without);
  for (ArmReading& reading : OtherTools(without, step_m)) readings.push_back(std::move(reading));
  return readings;
}

// Describes lengths of a tool, or heights of a base, beyond what is stated: "about 50 mm longer", "50 to 200 mm
// shorter".
std::string BeyondText(double least_m, double most_m, double step_m, const std::string& more, const std::string& less) {
  const bool is_less = most_m <= 0;
  const double from_m = is_less ? -most_m : least_m;
  const double to_m = is_less ? -least_m : most_m;
  return (to_m - from_m < 0.5 * step_m ? "about " + Fixed(1000 * from_m, 0)
                                       : Fixed(1000 * from_m, 0) + " to " + Fixed(1000 * to_m, 0)) +
         " mm " + (is_less ? less : more);
}

std::string LengthText(double length_m) { return "about " + Fixed(1000 * length_m, 0) + " mm"; }

// Describes a tool by its length: as stated (`lengths`), and beyond what robot.tool says (`beyond`).
std::string ToolText(const ArmReading& stated, const ArmReading& tool, const std::string& lengths,
                     const std::string& beyond) {
  const Rigid3d longer(stated.tip_from_gripper.rotation,
                       stated.tip_from_gripper.translation + Eigen::Vector3d(0, 0, tool.length_m));
  const bool is_along_config = !IsAtFlange(stated) && DistanceM(tool.tip_from_gripper, longer) < 1e-6;
  if (tool.length_m == 0) return "the flange itself, without robot.tool";
  if (is_along_config) return "a tool that is " + beyond + " along the flange's z axis than robot.tool says";
  return "a tool of " + lengths + " along the flange's z axis";
}

std::string ToolText(const ArmReading& stated, const ArmReading& tool) {
  return ToolText(stated, tool, LengthText(tool.length_m),
                  BeyondText(tool.length_m, tool.length_m, 1, "longer", "shorter"));
}

// Returns the least and the largest length of readings.
std::pair<double, double> RangeOf(const std::vector<ArmReading>& readings) {
  const auto [least, most] = std::minmax_element(readings.begin(), readings.end(),
                                                 [](const auto& a, const auto& b) { return a.length_m < b.length_m; });
  return {least->length_m, most->length_m};
}

// Describes the tools of several lengths.
std::string ToolsText(const ArmReading& stated, const std::vector<ArmReading>& tools, double step_m) {
  const auto [least_m, most_m] = RangeOf(tools);
  const std::string lengths = most_m - least_m < 0.5 * step_m
                                  ? LengthText(least_m)
                                  : Fixed(1000 * least_m, 0) + " to " + Fixed(1000 * most_m, 0) + " mm";
  return ToolText(stated, tools.front(), lengths, BeyondText(least_m, most_m, step_m, "longer", "shorter"));
}

std::string GainText(const FittedReading& better, const FittedReading& than) {
  const auto noise = [](const FittedReading& one) {
    return MmAndDeg(one.fit.robot_noise.translation_m, one.fit.robot_noise.rotation_rad);
  };
  return "log-likelihood higher by " + Significant(better.fit.log_likelihood - than.fit.log_likelihood, 3) +
         ", and the noise of the poses falls from " + noise(than) + " to " + noise(better);
}

// Returns how sure it is that one reading is right and another is not; nothing if it is not decidedly better.
std::optional<Severity> IsBetter(const FittedReading& one, const FittedReading& than) {
  const auto noise_m = [](const FittedReading& of) {
    return of.fit.robot_noise.translation_m + kLeverM * of.fit.robot_noise.rotation_rad;
  };
  const double share = noise_m(one) / noise_m(than);
  if (one.fit.log_likelihood < than.fit.log_likelihood + kLikelihoodLimits.log_likelihood) return std::nullopt;
  if (!(share < kLikelihoodLimits.noise)) return std::nullopt;
  return share < kLikelihoodLimits.noise_if_wrong ? Severity::kWrong : Severity::kRemark;
}

const FittedReading* MostLikely(const std::vector<FittedReading>& fitted) {
  const auto best = std::max_element(fitted.begin(), fitted.end(), [](const auto& a, const auto& b) {
    return a.fit.log_likelihood < b.fit.log_likelihood;
  });
  return best == fitted.end() ? nullptr : &*best;
}

std::string ToolSetting(const ArmReading& reading) {
  if (IsAtFlange(reading)) return "leave robot.tool out, or record the poses of the tool";
  constexpr double kSigmaMm = 1;  // The captures determine the tool to some mm only.
  constexpr double kSigmaRad = 1e-3;
  return "set robot.tool to the tool of the poses (" + PoseText(reading.tip_from_gripper, kSigmaMm, kSigmaRad) +
         ", or what the controller states), or record the poses of the flange";
}

// Returns the other arms that explain the captures nearly as well as `best`, as a clause in brackets; empty if there
// are none.
std::string NearlyAsGood(const std::vector<FittedReading>& fitted, const FittedReading& best) {
  std::vector<std::string> names;
  for (const FittedReading& one : fitted) {
    const std::string& name = one.reading.arm.name;
    if (one.reading.mistake != ArmReading::Mistake::kArm || name == best.reading.arm.name) continue;
    if (one.fit.log_likelihood < best.fit.log_likelihood - kLikelihoodLimits.log_likelihood) continue;
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names.empty() ? "" : " (nearly as good: " + Join(names, ", ") + ")";
}

// Returns the fault of an arm and a tool that reach all poses but that the captures contradict.
std::optional<Symptom> LikelierReading(const FittedReading& stated, const FittedReading& best,
                                       const std::vector<FittedReading>& others) {
  const std::optional<Severity> severity = IsBetter(best, stated);
  if (!severity) return std::nullopt;
  const std::string gain = " (" + GainText(best, stated) + ")";
  const std::string& arm = stated.reading.arm.name;
  if (best.reading.mistake == ArmReading::Mistake::kArm) {
    return Symptom{*severity,
                   "robot_model",
                   "the arm " + arm + " reaches all poses, but the arm " + best.reading.arm.name +
                       " explains the captures decidedly better" + gain,
                   "set " + SettingsText({ModelSetting(best.reading.arm)}) + NearlyAsGood(others, best),
                   {ModelSetting(best.reading.arm)}};
  }
  return Symptom{*severity, "robot_tool",
                 "the captures are explained decidedly better if the poses of the arm " + arm + " are those of " +
                     ToolText(stated.reading, best.reading) + gain,
                 ToolSetting(best.reading)};
}

// The comparison of readings by the captures.
struct ArmComparison {
  const WithoutArm& without;
  const std::vector<Rigid3d>& base_from_gripper;
  int num_threads;

  std::vector<FittedReading> Fit(const std::vector<ArmReading>& readings,
                                 const std::vector<std::string>& only = {}) const {
    return FitReadings(without.calibration, without.options, readings, base_from_gripper, only, num_threads);
  }
};

// Returns the best reading, with the length of its tool to some mm; nothing if there is none.
std::optional<FittedReading> BestOf(const ArmComparison& comparison, const std::vector<FittedReading>& fitted) {
  const FittedReading* best = MostLikely(fitted);
  if (best == nullptr) return std::nullopt;
  if (best->reading.mistake != ArmReading::Mistake::kTool || best->reading.length_m == 0) return *best;
  FittedReading finest = *best;
  for (const double step_m : {0.05, 0.025, 0.0125, 0.00625}) {
    std::vector<ArmReading> near(2, finest.reading);
    for (const size_t i : {0, 1}) {
      const double change_m = i == 0 ? step_m : -step_m;
      near[i].joints_near = finest.branch.joints;
      near[i].length_m += change_m;
      near[i].tip_from_gripper.translation.z() += change_m;
    }
    const std::vector<FittedReading> fits = comparison.Fit(near);
    const FittedReading* finer = MostLikely(fits);
    if (finer != nullptr && finer->fit.log_likelihood > finest.fit.log_likelihood) finest = *finer;
  }
  return finest;
}

// Returns the names of the configurations that may be those of the captures.
std::vector<std::string> LikelyConfigurations(const std::vector<FittedReading>& fitted, const FittedReading& best) {
  std::vector<std::string> names;
  for (const FittedReading& one : fitted) {
    if (one.fit.log_likelihood > best.fit.log_likelihood - kLikelihoodLimits.unlikely) names.push_back(one.branch.name);
  }
  return names;
}

// Returns the arms that may have been meant: those of the same maker if there are any.
std::vector<ArmReading> LikelyArms(const ArmReading& stated) {
  std::vector<ArmReading> arms = OtherArms(stated, Arms());
  if (!arms.empty() && HaveSameMaker(arms.front().arm, stated.arm)) {
    std::erase_if(arms, [&](const ArmReading& other) { return !HaveSameMaker(other.arm, stated.arm); });
  }
  return arms;
}

std::vector<Symptom> ExamineReached(const Examination& examination, const ArmReading& stated,
                                    const std::vector<Rigid3d>& poses, const std::vector<size_t>& order) {
  const std::optional<WithoutArm> without = CalibrateWithoutArm(examination);
  if (!without) return {};
  const ArmComparison comparison{*without, poses, examination.num_threads};
  const Dataset& data = examination.config.data;
  const std::optional<Configuration> near = data.arms.front()->joints_near.size() > 0
                                                ? ConfigurationOf(stated.arm, data.arms.front()->joints_near)
                                                : std::nullopt;
  const std::vector<std::string> named = near ? std::vector<std::string>{NameOf(*near)} : std::vector<std::string>();
  const std::vector<FittedReading> fits = comparison.Fit({stated}, named);
  const FittedReading* own = MostLikely(fits);
  if (own == nullptr) return {};
  std::vector<FittedReading> others = comparison.Fit(
      Reaching(LikelyArms(stated), poses, order, examination.num_threads), LikelyConfigurations(fits, *own));
  ArmReading near_own = stated;
  near_own.joints_near = own->branch.joints;
  const std::vector<ArmReading> tools =
      Reaching(ToolReadings(near_own, kComparedToolStepM), poses, order, examination.num_threads);
  for (FittedReading& tool : comparison.Fit(tools, {own->branch.name})) others.push_back(std::move(tool));
  if (const std::optional<FittedReading> best = BestOf(comparison, others)) {
    if (std::optional<Symptom> symptom = LikelierReading(*own, *best, others)) return {std::move(*symptom)};
  }
  return SingularSymptoms(data, own->branch, false);
}

// The readings of one kind that reach all poses, in words, with a cure.
struct Remedy {
  std::string condition;
  std::string cure;
  std::vector<ArmReading> readings;
  std::vector<ConfigSetting> settings = {};
};

std::vector<Remedy> RemediesFor(const ArmReading& stated, const std::vector<Rigid3d>& poses,
                                const std::vector<size_t>& order, int num_threads) {
  std::vector<Remedy> remedies;
  for (const ArmReading& arm : Reaching(OtherArms(stated, Arms()), poses, order, num_threads)) {
    const std::vector<ConfigSetting> settings = {ModelSetting(arm.arm)};
    remedies.push_back({"the arm " + arm.arm.name, "set " + SettingsText(settings), {arm}, settings});
  }
  const std::vector<ArmReading> tools = Reaching(ToolReadings(stated, kToolStepM), poses, order, num_threads);
  if (!tools.empty()) {
    remedies.push_back(
        {"this arm with " + ToolsText(stated, tools, kToolStepM), "set robot.tool as the controller states it", tools});
  }
  std::vector<ArmReading> heights = Reaching(OtherBases(stated, kBaseStepM), poses, order, num_threads);
  const auto is_hanging = [](const ArmReading& base) { return base.length_m == 0; };
  const auto hanging = std::find_if(heights.begin(), heights.end(), is_hanging);
  if (hanging != heights.end()) {
    remedies.push_back({"this arm if it hangs upside down in the base of the poses",
                        "record the poses in the arm's base",
                        {*hanging}});
    heights.erase(hanging);
  }
  if (!heights.empty()) {
    const auto [least_m, most_m] = RangeOf(heights);
    remedies.push_back({"this arm if it stands " + BeyondText(least_m, most_m, kBaseStepM, "higher", "lower") +
                            " than the base of the poses",
                        "record the poses in the arm's base", heights});
  }
  return remedies;
}

// The remedy that the captures support, with the best of its readings.
struct ChosenRemedy {
  const Remedy* remedy = nullptr;  // Null if they support none more than the others.
  std::optional<FittedReading> best;
  std::string why;      // The end of a sentence that begins with the name of the remedy.
  bool is_sure = true;  // Whether no other one explains the captures nearly as well.
};

ChosenRemedy Choose(const Examination& examination, const std::vector<Remedy>& remedies,
                    const std::vector<Rigid3d>& poses) {
  if (remedies.empty()) return {};
  const ChosenRemedy by_reach = remedies.size() == 1 ? ChosenRemedy{&remedies.front(), {}, "", true} : ChosenRemedy{};
  const std::optional<WithoutArm> without = CalibrateWithoutArm(examination);
  if (!without) return by_reach;
  const ArmComparison comparison{*without, poses, examination.num_threads};
  std::vector<std::pair<const Remedy*, FittedReading>> fitted;
  const auto is_likely = [&](const Remedy& remedy) {
    return HaveSameMaker(remedy.readings.front().arm, examination.config.data.arms.front()->arm);
  };
  const bool any_likely = std::any_of(remedies.begin(), remedies.end(), is_likely);
  for (const Remedy& remedy : remedies) {
    if (any_likely && !is_likely(remedy)) continue;
    constexpr size_t kMostLengths = 8;
    std::vector<ArmReading> tried;
    for (const size_t i : EvenIndices(remedy.readings.size(), kMostLengths)) tried.push_back(remedy.readings[i]);
    if (std::optional<FittedReading> best = BestOf(comparison, comparison.Fit(tried))) {
      fitted.emplace_back(&remedy, std::move(*best));
    }
  }
  std::sort(fitted.begin(), fitted.end(),
            [](const auto& a, const auto& b) { return a.second.fit.log_likelihood > b.second.fit.log_likelihood; });
  if (fitted.empty()) return by_reach;
  ChosenRemedy chosen{fitted.front().first, fitted.front().second, "", true};
  std::vector<std::string> nearly;
  for (size_t i = 1; i < fitted.size(); ++i) {
    const double lead = fitted[0].second.fit.log_likelihood - fitted[i].second.fit.log_likelihood;
    if (lead < kLikelihoodLimits.log_likelihood) nearly.push_back(fitted[i].first->condition);
  }
  constexpr size_t kMostNearly = 3;
  chosen.is_sure = nearly.empty();
  if (!nearly.empty()) {
    nearly.resize(std::min(nearly.size(), kMostNearly));
    chosen.why = "; the captures support the first of these most, and nearly as much " + Join(nearly, ", ");
  } else if (fitted.size() > 1) {
    const double lead = fitted[0].second.fit.log_likelihood - fitted[1].second.fit.log_likelihood;
    chosen.why = "; the captures support the first of these (log-likelihood higher by " + Significant(lead, 3) +
                 " than with " + fitted[1].first->condition + ")";
  }
  return chosen;
}

SymptomCode CodeOf(const ArmReading& reading) {
  if (reading.mistake == ArmReading::Mistake::kArm) return "robot_model";
  return reading.mistake == ArmReading::Mistake::kTool ? SymptomCode("robot_tool") : SymptomCode("robot_base");
}

// Returns the fault of an arm that does not reach the poses, or not in one configuration. `fault`: a clause that says
// so.
Symptom Unreachable(const Examination& examination, const ArmReading& stated, const std::vector<Rigid3d>& poses,
                    const std::string& fault, const std::vector<size_t>& order, bool reaches_each) {
  Symptom symptom{Severity::kWrong, "robot_unreachable", fault, ""};
  const std::vector<Remedy> remedies = RemediesFor(stated, poses, order, examination.num_threads);
  if (remedies.empty()) {
    symptom.what += "; nor does any other arm of the table, tool along the flange's z axis or height of the base";
    symptom.cure =
        "check that the poses are stated in the arm's base and that robot.tool is the tool of the controller; if only "
        "few captures are out of reach, check their poses";
    return symptom;
  }
  const ChosenRemedy chosen = Choose(examination, remedies, poses);
  std::vector<std::string> conditions;
  const bool is_tool = chosen.best && chosen.best->reading.mistake == ArmReading::Mistake::kTool;
  if (chosen.remedy != nullptr) {
    conditions.push_back(is_tool ? "this arm with " + ToolText(stated, chosen.best->reading)
                                 : chosen.remedy->condition);
  }
  for (const Remedy& remedy : remedies) {
    if (&remedy != chosen.remedy) conditions.push_back(remedy.condition);
  }
  constexpr size_t kMostConditions = 5;
  const size_t num_more = conditions.size() - std::min(conditions.size(), kMostConditions);
  conditions.resize(conditions.size() - num_more);
  symptom.what += "; all poses are reached by " + Join(conditions, ", or by ") +
                  (num_more == 0 ? "" : ", and in " + std::to_string(num_more) + " other ways") + chosen.why;
  symptom.cure = "check robot.model, robot.tool and the base of the poses";
  if (chosen.remedy != nullptr) {
    symptom.cure = chosen.remedy->cure;
    if (chosen.is_sure) symptom.settings = chosen.remedy->settings;
  }
  if (reaches_each && chosen.best) symptom.code = CodeOf(chosen.best->reading);
  if (is_tool) symptom.cure = ToolSetting(chosen.best->reading);
  if (!chosen.is_sure) symptom.cure += "; if that is not what was used, correct the one of these that applies";
  return symptom;
}

std::vector<Symptom> ExamineRecovered(const Examination& examination) {
  const Dataset& data = examination.config.data;
  ArmReading stated;
  stated.arm = data.arms.front()->arm;
  stated.tip_from_gripper = data.arms.front()->tip_from_gripper;
  constexpr int kMostJoints = 6;  // A redundant arm reaches a pose in infinitely many ways.
  if (stated.arm.num_joints() > kMostJoints) return {};
  std::vector<Rigid3d> poses;
  for (const Recording& capture : data.captures) poses.push_back(capture.base_from_gripper.front());
  const std::vector<Rigid3d> tips = TipPoses(stated, poses);
  std::vector<size_t> unreached;
  std::vector<size_t> reached;
  std::string reason;
  for (size_t i = 0; i < tips.size(); ++i) {
    const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(stated.arm, tips[i]);
    (postures ? reached : unreached).push_back(i);
    if (!postures && reason.empty()) reason = postures.reason();
  }
  std::vector<size_t> order = unreached;
  order.insert(order.end(), reached.begin(), reached.end());
  if (!unreached.empty()) {
    const std::string fault = "the arm " + stated.arm.name + " does not reach the poses of " +
                              std::to_string(unreached.size()) + " of " + std::to_string(poses.size()) + " captures (" +
                              data.captures[unreached.front()].name + ": " + reason + ")";
    return {Unreachable(examination, stated, poses, fault, order, false)};
  }
  if (Reaching({stated}, poses, order, 1).empty()) {
    return {Unreachable(examination, stated, poses,
                        "the arm " + stated.arm.name + " reaches every pose, but not all of them in one configuration",
                        order, true)};
  }
  return ExamineReached(examination, stated, poses, order);
}

}  // namespace

Checked Check_robot(const Examination& examination) {
  const Dataset& data = examination.config.data;
  // Poses that are read wrongly are those of no arm.
  if (data.arms.empty() || !data.arms.front() || data.captures.empty() || examination.found_wrong) return {};
  return {AreJointsRecorded(data, 0) ? ExamineRecorded(examination) : ExamineRecovered(examination)};
}

}  // namespace heba
