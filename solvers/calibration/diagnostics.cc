#include "solvers/calibration/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/data/joint_prior.h"
#include "heba/evaluation/limits.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/unknown_change.h"

namespace heba {
namespace {

double DistanceOf(const PairProblem& problem, const PairSolution& solution) {
  std::vector<Rigid3d> camera_from_target;
  for (const View& view : problem.views) {
    camera_from_target.push_back(CameraFromTarget(solution.hand_eye, CorrectedMount(problem.setup, view, solution)));
  }
  return WorkingDistance(camera_from_target);
}

bool HasGroup(const std::vector<TargetShapeGroup>& shape, TargetShapeGroup group) {
  return std::find(shape.begin(), shape.end(), group) != shape.end();
}

// Returns a part for each group of a shape's parameters: `shape_scale`, `shape_bend`,
// `shape_twist`, `shape_cubic`.
std::vector<Finding> ShapeParts(const TargetShape& shape, const std::vector<TargetShapeGroup>& groups) {
  std::vector<Finding> parts;
  if (HasGroup(groups, TargetShapeGroup::kScale)) {
    parts.push_back(
        {Grade::kGood, FindingCode("shape_scale"), {{"scale_x", shape.params[0]}, {"scale_y", shape.params[1]}}});
  }
  if (HasGroup(groups, TargetShapeGroup::kBend)) {
    parts.push_back({Grade::kGood,
                     FindingCode("shape_bend"),
                     {{"bend_x_mm", 1000 * shape.params[2]}, {"bend_y_mm", 1000 * shape.params[3]}}});
  }
  if (HasGroup(groups, TargetShapeGroup::kTwist)) {
    parts.push_back({Grade::kGood, FindingCode("shape_twist"), {{"twist_mm", 1000 * shape.params[4]}}});
  }
  if (HasGroup(groups, TargetShapeGroup::kCubic)) {
    double largest_m = 0;
    for (int i = 0; i < TargetShape::kNumParams; ++i) {
      const double height_m = std::abs(shape.params[static_cast<size_t>(i)]);
      if (ShapeGroupOf(i) == TargetShapeGroup::kCubic) largest_m = std::max(largest_m, height_m);
    }
    parts.push_back({Grade::kGood, FindingCode("shape_cubic"), {{"cubic_mm", 1000 * largest_m}}});
  }
  return parts;
}

// Returns a finding with the largest change in sigmas among focal lengths and principal point, or that one of them
// which `part` is: the name `intrinsic`, such as fx, and the numbers fx_px and fx_sigmas; without them if no sigma of
// these is known.
Finding WithLargestMove(Finding finding, const Camera& given, const Camera& camera, const Covariance& covariance,
                        std::string_view block, const std::optional<ParameterGroup>& part = std::nullopt) {
  std::string largest;
  double by_px = 0;
  double sigmas = 0;
  for (size_t i = 0; i < 4; ++i) {
    if (part && GroupOf(static_cast<int>(i)) != *part) continue;
    const std::string& name = camera.Model().param_names()[i];
    const std::optional<double> sigma = SigmaOf(covariance, std::string(block) + "." + name);
    const double move_px = camera.params[i] - given.params[i];
    if (!sigma || (!largest.empty() && std::abs(move_px / *sigma) <= std::abs(sigmas))) continue;
    largest = name;
    by_px = move_px;
    sigmas = move_px / *sigma;
  }
  if (largest.empty()) return finding;
  finding.names.emplace_back("intrinsic", largest);
  finding.numbers.emplace_back(largest + "_px", by_px);
  finding.numbers.emplace_back(largest + "_sigmas", sigmas);
  return finding;
}

// Returns the part of the intrinsics that alone explains their difference, with the information H about all of them:
// with only the part g free, the squares fall by b_g^T H_gg^-1 b_g, b = H d, and what is left of d^T H d is chance.
// Nothing if it takes several parts.
std::optional<ParameterGroup> ExplainingPart(const Eigen::VectorXd& difference, const Eigen::MatrixXd& information,
                                             double covariance_dof) {
  const Eigen::VectorXd gradient = information * difference;
  const double squares = difference.dot(gradient);
  constexpr double kByChance = 0.001;
  double largest = 0;
  std::optional<ParameterGroup> explaining;
  for (const ParameterGroup part :
       {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint, ParameterGroup::kDistortion}) {
    std::vector<Eigen::Index> of_part;
    for (Eigen::Index i = 0; i < difference.size(); ++i) {
      if (GroupOf(static_cast<int>(i)) == part) of_part.push_back(i);
    }
    const auto num_others = static_cast<double>(difference.size()) - static_cast<double>(of_part.size());
    if (of_part.empty() || num_others == 0) continue;
    const Eigen::VectorXd own = gradient(of_part);
    const double gain = own.dot(SolveSymmetric(information(of_part, of_part), own));
    const double left = std::max(0.0, squares - gain);
    if (gain <= largest || FisherTail(left / num_others, num_others, covariance_dof) < kByChance) continue;
    largest = gain;
    explaining = part;
  }
  return explaining;
}

// Returns the change from one solution to another, in the layout of the first one's covariance.
Eigen::VectorXd ChangeBetween(const PairSolution& from, const PairSolution& to) {
  UnknownChange change(from.covariance.layout);
  change.SetPose(kHandEyeBlock, from.hand_eye.camera_mount_from_camera, to.hand_eye.camera_mount_from_camera);
  change.SetPose(kBoardBlock, from.hand_eye.target_mount_from_target, to.hand_eye.target_mount_from_target);
  change.SetParams(kCameraBlock, from.camera.params, to.camera.params);
  change.SetParams(kTargetBlock, from.shape.params, to.shape.params);
  return change.vector();
}

}  // namespace

Finding DescribeModel(const ErrorModel& chosen, const std::vector<ModelAlternative>& alternatives,
                      const PairSolution& solution) {
  Finding finding{Grade::kGood, FindingCode("model"), {}, {{"model", NameOf(chosen)}}};
  if (solution.robot_noise && chosen.robot != BundleOptions::Robot::kExact) {
    finding.numbers = {{"robot_mm", 1000 * solution.robot_noise->translation_m},
                       {"robot_deg", RadToDeg(solution.robot_noise->rotation_rad)}};
  }
  if (!chosen.shape.empty()) finding.parts = ShapeParts(solution.shape, chosen.shape);
  if (alternatives.size() < 2) return finding;
  const ModelAlternative* self = nullptr;
  for (const ModelAlternative& alternative : alternatives) {
    const bool is_chosen = alternative.model.robot == chosen.robot && alternative.model.shape == chosen.shape &&
                           alternative.model.effects == chosen.effects;
    if (is_chosen) self = &alternative;
  }
  if (self == nullptr) return finding;
  // Compares with the simplest model if that was rejected, otherwise with the largest.
  const ModelAlternative& simplest = alternatives.front();
  const ModelAlternative& largest = alternatives.back();
  if (&simplest != self) {
    if (simplest.p.value_or(0) >= kRandomErrorsRejected) return finding;  // Its odds were too small.
    finding.parts.push_back(
        {Grade::kGood,
         FindingCode("rejected_model"),
         {{"log_likelihood_lower_by", self->log_likelihood - simplest.log_likelihood}, {"p", simplest.p.value_or(0)}},
         {{"model", NameOf(simplest.model)}}});
  } else {
    finding.parts.push_back(
        {Grade::kGood,
         FindingCode("no_better_model"),
         {{"log_likelihood_higher_by", largest.log_likelihood - self->log_likelihood}, {"p", self->p.value_or(1)}},
         {{"model", NameOf(largest.model)}}});
  }
  return finding;
}

Advice DiagnoseModel(const PairProblem& problem, const PairSolution& solution, const BundleOptions& options,
                     const AutoModel& chosen) {
  const bool asks_robot = !chosen.robot_noise && options.robot == BundleOptions::Robot::kExact;
  const bool asks_shape = !chosen.target_shape && options.free_shape.empty();
  constexpr size_t kMinCaptures = 6;
  if ((!asks_robot && !asks_shape) || problem.views.size() < kMinCaptures) return {};
  PairProblem at = problem;
  at.camera = solution.camera;
  BundleOptions kept = options;
  kept.loss = OfInliers(options.loss);
  const Outcome<ModelChoice> choice = ChooseModel(at, solution.hand_eye, kept, {true, asks_shape});
  if (!choice || choice->alternatives.empty()) return {};
  const ErrorModel& model = choice->alternatives[choice->chosen].model;
  Advice advice;
  if (asks_shape && !model.shape.empty()) {
    constexpr double kScaleMatters = 3e-4;
    constexpr double kBendMattersM = 1e-4;
    const TargetShape& shape = choice->solution.shape;
    const double scale = std::max(std::abs(shape.params[0] - 1), std::abs(shape.params[1] - 1));
    const double bend_m = LargestHeightM(shape);
    if (scale > kScaleMatters || bend_m > kBendMattersM) {
      const bool is_held = std::find(options.free_intrinsics.begin(), options.free_intrinsics.end(),
                                     ParameterGroup::kFocal) == options.free_intrinsics.end();
      Finding& ignored = advice.findings.emplace_back(Finding{Grade::kDoubtful, FindingCode("target_shape_ignored")});
      ignored.numbers = {{"scale_x", shape.params[0]},
                         {"scale_y", shape.params[1]},
                         {"bend_x_mm", 1000 * shape.params[2]},
                         {"bend_y_mm", 1000 * shape.params[3]},
                         {"twist_mm", 1000 * shape.params[4]}};
      ignored.names = {{"focal_length", is_held ? "held" : "free"}};
      ignored.parts = ShapeParts(shape, model.shape);
    }
  }
  if (asks_robot && choice->solution.robot_noise && model.robot != BundleOptions::Robot::kExact) {
    const RobotNoise& noise = *choice->solution.robot_noise;
    advice.findings.push_back(
        {Grade::kDoubtful,
         FindingCode("robot_noise_ignored"),
         {{"robot_mm", 1000 * noise.translation_m}, {"robot_deg", RadToDeg(noise.rotation_rad)}}});
  }
  if (!advice.findings.empty()) advice.changes = {ChangeBetween(solution, choice->solution)};
  return advice;
}

std::optional<Finding> JudgeScale(const TargetShape& shape, const Covariance& covariance, std::string_view block_name,
                                  bool is_focal_held, double known_sigma) {
  constexpr double kOfPrint = 5e-3;
  constexpr double kWrong = 0.02;
  constexpr double kSigmas = 3;
  constexpr double kContradicts = 4;
  double sigma = 0;
  const UnknownBlock block = covariance.layout.Block(block_name);
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    if (covariance.layout[i].group == UnknownGroup::kScale) {
      sigma = std::max(sigma, std::sqrt(covariance.matrix(i, i)));
    }
  }
  const double deviation = std::max(std::abs(shape.params[0] - 1), std::abs(shape.params[1] - 1));
  // The part of the deviation that its uncertainty does not explain.
  const double off = deviation - kSigmas * sigma;
  if (off <= kOfPrint && deviation <= kContradicts * std::hypot(sigma, known_sigma)) return std::nullopt;
  Finding finding{off > kWrong ? Grade::kBad : Grade::kDoubtful,
                  FindingCode("target_scale"),
                  {{"scale_x", shape.params[0]},
                   {"scale_y", shape.params[1]},
                   {"scale_sigma", sigma},
                   {"known_sigma", known_sigma}},
                  {{"focal_length", is_focal_held ? "held" : "free"}}};
  finding.is_cause = true;
  return finding;
}

Advice DiagnoseHeldIntrinsics(const PairProblem& problem, const PairSolution& solution, const BundleOptions& options_in,
                              const AutoModel& choose) {
  if (!options_in.free_intrinsics.empty()) return {};
  BundleOptions options = options_in;
  options.free_intrinsics = BundleOptions().free_intrinsics;
  options.loss = OfInliers(options.loss);
  PairProblem at = problem;
  at.camera = solution.camera;
  at.shape = solution.shape;
  // The best error model may be another one with free intrinsics.
  const Outcome<ModelChoice> choice = ChooseModel(at, solution.hand_eye, options, choose);
  if (!choice) return {};
  const PairSolution& freed = choice->solution;
  std::optional<Finding> finding = JudgeHeldIntrinsics(
      solution.camera, freed.camera, freed.covariance, kCameraBlock, freed.covariance_dof,
      {solution.hand_eye.camera_mount_from_camera, freed.hand_eye.camera_mount_from_camera,
       DistanceM(solution.hand_eye.target_mount_from_target, freed.hand_eye.target_mount_from_target),
       DistanceOf(problem, solution)});
  if (!finding) return {};
  return {{std::move(*finding)}, {ChangeBetween(solution, freed)}};
}

std::optional<Finding> JudgeHeldIntrinsics(const Camera& held, const Camera& freed, const Covariance& all,
                                           std::string_view block, double covariance_dof, const FreedPoses& poses) {
  const UnknownBlock camera = all.layout.Block(block);
  const Eigen::Index num_intrinsics = camera.size;
  CHECK_EQ(num_intrinsics, NumParams(held.Model()));
  const Eigen::MatrixXd covariance = all.matrix.block(camera.first, camera.first, num_intrinsics, num_intrinsics);
  Eigen::VectorXd difference(num_intrinsics);
  for (Eigen::Index i = 0; i < num_intrinsics; ++i) {
    const auto k = static_cast<size_t>(i);
    difference[i] = freed.params[k] - held.params[k];
  }
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::VectorXd scaled = scale.cwiseProduct(difference);
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  const double squares = MahalanobisSquare(scaled, correlation);
  const double dof = static_cast<double>(num_intrinsics);
  constexpr double kBeyondDoubt = 1e-4;
  const double p = FisherTail(std::max(0.0, squares) / dof, dof, covariance_dof);
  if (!(p < kBeyondDoubt)) return std::nullopt;
  const double move_m = DistanceM(poses.mount_from_held, poses.mount_from_freed);
  const double move_rad = AngleRad(poses.mount_from_held, poses.mount_from_freed);
  // A move that does not matter is no finding.
  constexpr double kLeastShare = 0.001;
  constexpr double kBadShare = 0.01;
  if (std::max(move_m / poses.distance_m, move_rad) <= kLeastShare) return std::nullopt;
  const bool is_bad = poses.target_move_m / poses.distance_m > kBadShare;
  Finding finding{is_bad ? Grade::kBad : Grade::kDoubtful, FindingCode("held_intrinsics")};
  const std::optional<ParameterGroup> part = ExplainingPart(scaled, InverseOfSymmetric(correlation), covariance_dof);
  if (part) finding.names.emplace_back("part", std::string(kParameterGroupNames[static_cast<size_t>(*part)]));
  finding = WithLargestMove(std::move(finding), held, freed, all, block, part);
  finding.numbers.emplace_back("move_mm", 1000 * move_m);
  finding.numbers.emplace_back("move_deg", RadToDeg(move_rad));
  finding.numbers.emplace_back("target_move_mm", 1000 * poses.target_move_m);
  finding.numbers.emplace_back("p", p);
  finding.is_cause = true;
  return finding;
}

Finding DescribeCameraUse(const Camera& given, const PairSolution& solution, const BundleOptions& options) {
  Finding finding{Grade::kGood, FindingCode("camera")};
  if (options.free_intrinsics.empty()) {
    finding.names = {{"use", "held"}};
    return finding;
  }
  const bool is_known_earlier =
      options.prior != nullptr && options.prior->covariance.layout.Block(kCameraBlock).size > 0;
  finding.names = {{"use", options.camera_prior || is_known_earlier ? "prior" : "initial_guess"}};
  return WithLargestMove(std::move(finding), given, solution.camera, solution.covariance, kCameraBlock);
}

}  // namespace heba
