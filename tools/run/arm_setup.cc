#include "tools/run/arm_setup.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "heba/base/even_indices.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

// How well the errors that arms have explain the scatter of the tool that recorded joints imply.
struct ToolScatter {
  double rms_m = 0;          // The scatter.
  double unexplained_m = 0;  // The part of it that remains, at the gripper.
  double largest_error = 0;  // The largest error of the arm that it takes, in standard deviations of arms.
  bool IsExplained() const {
    constexpr double kMostUnexplainedM = 1e-3;
    constexpr double kMostSigmas = 4;
    return unexplained_m < kMostUnexplainedM && largest_error < kMostSigmas;
  }
};

// The controller computes its poses with its own parameters, which may be those of this very arm. Estimates them, with
// the standard deviations of arms as their prior, from the tools that the nominal parameters give.
ToolScatter ExplainTools(const Arm& arm, const ArmBranch& branch, const std::vector<Rigid3d>& tools,
                         const Rigid3d& mean) {
  const SharedEffects errors = ArmErrors(arm, ArmErrorModel::kGeometry);
  constexpr double kRoundingM = 1e-4;
  constexpr double kRoundingRad = 1e-4;
  // The tool itself is unknown, too.
  const Eigen::Index num = errors.size() + 6;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(num, num);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(num);
  Eigen::VectorXd sigmas(errors.size());
  for (Eigen::Index j = 0; j < errors.size(); ++j) {
    const EffectGroup& group = errors.groups[errors.effects[static_cast<size_t>(j)].group];
    sigmas[j] = std::max(group.sigma, group.most_sigma);
    normal(j, j) = 1 / (sigmas[j] * sigmas[j]);
  }
  Tangent6 weights;
  weights << Eigen::Vector3d::Constant(1 / kRoundingM), Eigen::Vector3d::Constant(1 / kRoundingRad);
  std::vector<Eigen::MatrixXd> rows;
  std::vector<Tangent6> offsets;
  ToolScatter scatter;
  for (size_t i = 0; i < tools.size(); ++i) {
    Matrix6X by_all;
    MakeArmEffect(arm, branch.joints[i], mean)->Evaluate(Eigen::VectorXd::Zero(arm.num_params()), &by_all);
    Eigen::MatrixXd by_errors(6, num);
    for (Eigen::Index j = 0; j < errors.size(); ++j) {
      by_errors.col(j) = by_all.col(errors.effects[static_cast<size_t>(j)].index);
    }
    by_errors.rightCols<6>().setIdentity();
    rows.emplace_back(weights.asDiagonal() * by_errors);
    const Tangent6 offset = LocalCoordinates(mean, tools[i]);
    scatter.rms_m += offset.head<3>().squaredNorm();
    offsets.push_back(weights.cwiseProduct(offset));
    normal += rows.back().transpose() * rows.back();
    right += rows.back().transpose() * offsets.back();
  }
  const Eigen::VectorXd found = SolveSymmetric(normal, right);
  for (size_t i = 0; i < tools.size(); ++i) {
    scatter.unexplained_m += (rows[i] * found - offsets[i]).head<3>().squaredNorm() * kRoundingM * kRoundingM;
  }
  const auto num_captures = static_cast<double>(tools.size());
  scatter.rms_m = std::sqrt(scatter.rms_m / num_captures);
  scatter.unexplained_m = std::sqrt(scatter.unexplained_m / num_captures);
  scatter.largest_error = found.head(errors.size()).cwiseQuotient(sigmas).lpNorm<Eigen::Infinity>();
  return scatter;
}

Eigen::VectorXd JointsOf(const Recording& capture, size_t robot) {
  const std::vector<double>& joints = capture.joints[robot];
  return Eigen::Map<const Eigen::VectorXd>(joints.data(), static_cast<Eigen::Index>(joints.size()));
}

// Returns the pose of the gripper on the tip that recorded joints imply, for each capture.
std::vector<Rigid3d> ImpliedTools(const Dataset& dataset, size_t robot) {
  std::vector<Rigid3d> tools;
  for (const Recording& capture : dataset.captures) {
    const Rigid3d base_from_tip = BaseFromTip(dataset.arms[robot]->arm, JointsOf(capture, robot));
    tools.push_back(Inverse(base_from_tip) * capture.base_from_gripper[robot]);
  }
  return tools;
}

bool IsNear(const Rigid3d& tool, const Rigid3d& other) {
  return DistanceM(tool, other) < kMostToolScatterM && RadToDeg(AngleRad(tool, other)) < kMostToolScatterDeg;
}

// Returns the joints and the tool from recorded joints.
ArmSetup SetUpRecorded(const Dataset& dataset, size_t robot) {
  const Arm& arm = dataset.arms[robot]->arm;
  ArmSetup setup;
  setup.is_recorded = true;
  ArmBranch branch{"recorded", {}};
  for (const Recording& capture : dataset.captures) branch.joints.push_back(JointsOf(capture, robot));
  const std::vector<Rigid3d> tools = ImpliedTools(dataset, robot);
  setup.tip_from_gripper = MeanPose(tools);
  for (size_t i = 0; i < tools.size(); ++i) {
    if (IsNear(tools[i], setup.tip_from_gripper)) continue;
    setup.reason = {FailureCode("tool_scatter"),
                    {{"apart_mm", 1000 * DistanceM(tools[i], setup.tip_from_gripper)},
                     {"apart_deg", RadToDeg(AngleRad(tools[i], setup.tip_from_gripper))}},
                    {{"capture", dataset.captures[i].name}}};
    return setup;
  }
  const ToolScatter scatter = ExplainTools(arm, branch, tools, setup.tip_from_gripper);
  if (!scatter.IsExplained()) {
    setup.reason = {FailureCode("tool_not_explained"),
                    {{"scatter_mm", 1000 * scatter.rms_m}, {"unexplained_mm", 1000 * scatter.unexplained_m}},
                    {{"arm", arm.name}}};
    return setup;
  }
  setup.branches.push_back(std::move(branch));
  return setup;
}

// Returns, for each capture, its posture that is nearest to that of the capture before it.
std::optional<ArmBranch> Continued(const Dataset& dataset, size_t robot, Eigen::VectorXd near) {
  const Rigid3d gripper_from_tip = Inverse(dataset.arms[robot]->tip_from_gripper);
  ArmBranch branch;
  for (const Recording& capture : dataset.captures) {
    const Outcome<Eigen::VectorXd> found =
        PostureNear(dataset.arms[robot]->arm, capture.base_from_gripper[robot] * gripper_from_tip, near);
    if (!found) return std::nullopt;
    near = *found;
    branch.joints.push_back(*found);
  }
  return branch;
}

// Returns the joints that reach the poses.
ArmSetup SetUpRecovered(const Dataset& dataset, size_t robot) {
  ArmSetup setup;
  const RobotArm& of_robot = *dataset.arms[robot];
  const Arm& arm = of_robot.arm;
  setup.tip_from_gripper = of_robot.tip_from_gripper;
  const Rigid3d gripper_from_tip = Inverse(of_robot.tip_from_gripper);
  const bool has_near = of_robot.joints_near.size() > 0;
  const std::optional<Configuration> configuration_near =
      has_near ? ConfigurationOf(arm, of_robot.joints_near) : std::nullopt;
  if (has_near && !configuration_near) {
    if (std::optional<ArmBranch> branch = Continued(dataset, robot, of_robot.joints_near)) {
      setup.branches.push_back(std::move(*branch));
    } else {
      setup.reason = FailureCode("no_posture_near");
    }
    return setup;
  }
  if (arm.num_joints() > 6) {
    setup.reason = {FailureCode("nameless_configurations"), {}, {{"arm", arm.name}}};
    return setup;
  }
  std::vector<Rigid3d> base_from_tip;
  std::vector<std::vector<Eigen::VectorXd>> postures;
  for (const Recording& capture : dataset.captures) {
    base_from_tip.push_back(capture.base_from_gripper[robot] * gripper_from_tip);
    Outcome<std::vector<Eigen::VectorXd>> found = PosturesOf(arm, base_from_tip.back());
    if (!found) {
      setup.reason = {
          FailureCode("out_of_reach"), {}, {{"arm", arm.name}, {"capture", capture.name}}, {found.failure()}};
      return setup;
    }
    if (!ConfigurationOf(arm, found->front())) {
      setup.reason = {FailureCode("nameless_configurations"), {}, {{"arm", arm.name}}};
      return setup;
    }
    postures.push_back(std::move(*found));
  }
  for (ArmBranch& branch : BranchesOf(arm, base_from_tip, postures)) {
    // The stated configuration is that of the first capture; those of the others are found as without it.
    if (configuration_near && branch.name != NameOf(*configuration_near) && branch.Reaches(0)) {
      branch.joints.front() = Eigen::VectorXd();
      branch.is_out_of_reach.front() = true;
    }
    setup.branches.push_back(std::move(branch));
  }
  const bool is_first_reached = std::any_of(setup.branches.begin(), setup.branches.end(),
                                            [](const ArmBranch& branch) { return branch.Reaches(0); });
  if (!is_first_reached) setup.reason = {FailureCode("near_out_of_reach"), {}, {{"arm", arm.name}}};
  return setup;
}

// The joints of a capture in a branch that is being completed.
struct BranchCapture {
  std::optional<Eigen::VectorXd> in_configuration;  // A posture in the branch's configuration.
  bool is_regular = false;                          // Whether that posture is far from all singularities.
  bool can_be_singular = false;                     // Whether any posture of the capture is singular.
};

// Returns the regular posture of the capture that is next to capture `i`; null if there is none.
const Eigen::VectorXd* NextRegular(const std::vector<BranchCapture>& captures, size_t i) {
  const Eigen::VectorXd* next = nullptr;
  size_t least = captures.size();
  for (size_t k = 0; k < captures.size(); ++k) {
    const size_t apart = k > i ? k - i : i - k;
    if (!captures[k].is_regular || apart >= least) continue;
    least = apart;
    next = &*captures[k].in_configuration;
  }
  return next;
}

// Returns the joints of all captures in one configuration.
ArmBranch Completed(const Arm& arm, const std::vector<Rigid3d>& base_from_tip, const Configuration& configuration,
                    const std::vector<BranchCapture>& captures) {
  ArmBranch branch{NameOf(configuration), {}};
  for (size_t i = 0; i < captures.size(); ++i) {
    const BranchCapture& capture = captures[i];
    branch.is_out_of_reach.push_back(!capture.is_regular && !capture.in_configuration && !capture.can_be_singular);
    if (branch.is_out_of_reach.back()) {
      branch.joints.emplace_back();
      continue;
    }
    if (capture.is_regular) {
      branch.joints.push_back(*capture.in_configuration);
      continue;
    }
    branch.joints.push_back(capture.in_configuration.value_or(Eigen::VectorXd()));
    const Eigen::VectorXd* next = NextRegular(captures, i);
    if (next == nullptr) continue;
    const Outcome<Eigen::VectorXd> near = PostureNear(arm, base_from_tip[i], *next);
    if (near && (ConfigurationOf(arm, *near) == configuration || !SingularityAt(arm, *near).empty())) {
      branch.joints.back() = *near;
    }
  }
  return branch;
}

}  // namespace

bool AreJointsRecorded(const Dataset& dataset, size_t robot) {
  return std::all_of(dataset.captures.begin(), dataset.captures.end(), [&](const Recording& capture) {
    return !capture.joints.empty() && !capture.joints[robot].empty();
  });
}

std::vector<ContradictingJoints> FindContradictingJoints(const Dataset& dataset, size_t robot) {
  const bool is_known = !dataset.arms.empty() && dataset.arms[robot];
  if (!is_known || dataset.captures.empty() || !AreJointsRecorded(dataset, robot)) return {};
  const std::vector<Rigid3d> tools = ImpliedTools(dataset, robot);
  // The tool of a capture that is near most others is not affected by the rest.
  constexpr size_t kMostStarts = 50;
  std::vector<ContradictingJoints> fewest;
  for (const size_t start : EvenIndices(tools.size(), kMostStarts)) {
    std::vector<ContradictingJoints> apart;
    for (size_t i = 0; i < tools.size(); ++i) {
      if (IsNear(tools[i], tools[start])) continue;
      apart.push_back({i, DistanceM(tools[i], tools[start]), AngleRad(tools[i], tools[start])});
    }
    if (start == 0 || apart.size() < fewest.size()) fewest = std::move(apart);
  }
  constexpr double kMostWrong = 0.3;
  if (static_cast<double>(fewest.size()) > kMostWrong * static_cast<double>(tools.size())) return {};
  return fewest;
}

std::string WhyLeftOut(const ContradictingJoints& joints, const std::string& whose) {
  return whose + " put the tool " + Significant(1000 * joints.apart_m, 2) + " mm and " +
         Significant(RadToDeg(joints.apart_rad), 2) +
         " deg from where those of the other captures do: its joints or its pose are wrong";
}

bool IsContradiction(const Failure& reason) {
  constexpr FailureCode kContradictions[] = {FailureCode("tool_scatter"), FailureCode("tool_not_explained"),
                                             FailureCode("out_of_reach")};
  return std::any_of(std::begin(kContradictions), std::end(kContradictions),
                     [&](const FailureCode& code) { return reason.code == code.name(); });
}

bool ArmBranch::ReachesAll() const {
  return std::find(is_out_of_reach.begin(), is_out_of_reach.end(), true) == is_out_of_reach.end();
}

ArmBranch Combined(const std::vector<ArmBranch>& branches, const std::vector<size_t>& branch_of_captures) {
  ArmBranch combined;
  std::vector<std::string> names;
  for (size_t i = 0; i < branch_of_captures.size(); ++i) {
    const ArmBranch& branch = branches[branch_of_captures[i]];
    combined.joints.push_back(branch.joints[i]);
    if (std::find(names.begin(), names.end(), branch.name) == names.end()) names.push_back(branch.name);
  }
  combined.name = Join(names, "; ");
  return combined;
}

std::vector<ArmBranch> BranchesOf(const Arm& arm, const std::vector<Rigid3d>& base_from_tip,
                                  const std::vector<std::vector<Eigen::VectorXd>>& postures) {
  CHECK_EQ(base_from_tip.size(), postures.size());
  std::map<Configuration, std::vector<BranchCapture>> captures_in;
  std::vector<bool> can_be_singular(postures.size(), false);
  for (size_t i = 0; i < postures.size(); ++i) {
    for (const Eigen::VectorXd& posture : postures[i]) {
      const std::optional<Configuration> configuration = ConfigurationOf(arm, posture);
      if (!configuration) return {};
      const bool is_regular = SingularityAt(arm, posture).empty();
      if (!is_regular) can_be_singular[i] = true;
      std::vector<BranchCapture>& captures = captures_in[*configuration];
      captures.resize(postures.size());
      if (captures[i].in_configuration && (captures[i].is_regular || !is_regular)) continue;
      captures[i].in_configuration = posture;
      captures[i].is_regular = is_regular;
    }
  }
  std::vector<ArmBranch> branches;
  for (auto& [configuration, captures] : captures_in) {
    for (size_t i = 0; i < captures.size(); ++i) captures[i].can_be_singular = can_be_singular[i];
    branches.push_back(Completed(arm, base_from_tip, configuration, captures));
  }
  return branches;
}

std::vector<SingularCapture> SingularCaptures(const Arm& arm, const ArmBranch& branch) {
  std::vector<SingularCapture> singular;
  for (size_t i = 0; i < branch.joints.size(); ++i) {
    const std::string at =
        branch.joints[i].size() == 0 ? "its joints could not be recovered" : SingularityAt(arm, branch.joints[i]);
    if (!at.empty()) singular.push_back({i, at});
  }
  return singular;
}

ArmSetup SetUpArm(const Dataset& dataset, size_t robot, Kinematics kinematics) {
  ArmSetup setup = AreJointsRecorded(dataset, robot) ? SetUpRecorded(dataset, robot) : SetUpRecovered(dataset, robot);
  const bool lacks_masses = kinematics == Kinematics::kGravity && dataset.arms[robot]->arm.load == nullptr;
  if (lacks_masses && setup.reason.empty()) {
    setup.reason = FailureCode("no_masses");
  }
  return setup;
}

std::vector<std::shared_ptr<const PoseEffect>> EffectsOf(const Arm& arm, const Rigid3d& tip_from_gripper,
                                                         const ArmBranch& branch) {
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  for (const Eigen::VectorXd& joints : branch.joints) {
    effects.push_back(joints.size() == 0 ? nullptr : MakeArmEffect(arm, joints, tip_from_gripper));
  }
  return effects;
}

std::vector<std::shared_ptr<const SharedEffects>> CandidateArmErrors(const Arm& arm, Kinematics kinematics) {
  const auto errors_of = [&](ArmErrorModel model) {
    return std::make_shared<const SharedEffects>(ArmErrors(arm, model));
  };
  switch (kinematics) {
    case Kinematics::kNone:
      return {};
    case Kinematics::kOffsets:
      return {errors_of(ArmErrorModel::kOffsets)};
    case Kinematics::kGeometry:
      return {errors_of(ArmErrorModel::kGeometry)};
    case Kinematics::kGravity:
      return {errors_of(ArmErrorModel::kGravity)};
    case Kinematics::kAuto:
      break;
  }
  return {errors_of(ArmErrorModel::kOffsets), errors_of(ArmErrorModel::kGeometry)};
}

ArmErrorModels ErrorsOfArm(const Arm& arm, const ArmSetup& setup, Kinematics kinematics) {
  ArmErrorModels errors;
  errors.models = CandidateArmErrors(arm, kinematics);
  errors.is_chosen = kinematics == Kinematics::kAuto;
  errors.of_branches = std::make_shared<const SharedEffects>(ArmErrors(arm, ArmErrorModel::kGeometry));
  for (const ArmBranch& branch : setup.branches) {
    auto& effects = errors.effects_of_captures.emplace_back(EffectsOf(arm, setup.tip_from_gripper, branch));
    for (size_t i = 0; i < effects.size(); ++i) {
      if (effects[i] == nullptr && branch.Reaches(i)) {
        effects[i] = MakeLinearEffect(Matrix6X::Zero(6, arm.num_params()));
      }
    }
    errors.positions_of_captures.push_back(branch.joints);
    // Servo errors are those of joints: beside the errors of an arm, white noise alone misjudges what the captures say.
    std::vector<Matrix6X>& by_joints = errors.joints_of_captures.emplace_back();
    for (const Eigen::VectorXd& joints : branch.joints) {
      by_joints.push_back(joints.size() == 0 ? Matrix6X(6, 0) : GripperByJoints(arm, joints, setup.tip_from_gripper));
    }
  }
  return errors;
}

}  // namespace heba
