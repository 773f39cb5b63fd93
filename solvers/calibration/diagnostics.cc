#include "solvers/calibration/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Eigenvalues>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"
#include "solvers/refine/bundle_model.h"
#include "solvers/uncertainty/robot_noise.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {
namespace {

// A direction of the unknowns whose sigma is larger than it should be.
struct WeakDirection {
  std::string name;
  Eigen::VectorXd direction;  // Unit vector in the space of the unknowns.
  double sigma = 0;
  double wanted = 0;
  std::string unit;
  double unit_size = 1;  // Size of `unit`, in the unknowns' unit.
};

std::string AxisName(const Eigen::Vector3d& direction, const Eigen::Matrix3d& parent_from_child,
                     const std::string& parent, const std::string& child) {
  constexpr double kNearAxis = 0.9;
  const Eigen::Vector3d in_parent = parent_from_child * direction;
  Eigen::Index child_axis = 0;
  Eigen::Index parent_axis = 0;
  const double child_part = direction.cwiseAbs().maxCoeff(&child_axis);
  const double parent_part = in_parent.cwiseAbs().maxCoeff(&parent_axis);
  if (std::max(child_part, parent_part) < kNearAxis) {
    return "[" + Fixed(direction.x(), 2) + ", " + Fixed(direction.y(), 2) + ", " + Fixed(direction.z(), 2) +
           "] of the " + child;
  }
  const bool by_child = child_part >= parent_part;
  return "the " + (by_child ? child : parent) + "'s " + std::string(1, "xyz"[by_child ? child_axis : parent_axis]);
}

// Returns the direction of the largest variance within three unknowns.
WeakDirection WorstOf(const Eigen::MatrixXd& covariance, Eigen::Index first, const std::string& what,
                      const Eigen::Matrix3d& parent_from_child, const std::string& parent, const std::string& child) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance.block<3, 3>(first, first));
  WeakDirection weakness;
  weakness.direction = Eigen::VectorXd::Zero(covariance.rows());
  weakness.direction.segment<3>(first) = eigen.eigenvectors().col(2);
  weakness.sigma = std::sqrt(std::max(0.0, eigen.eigenvalues()[2]));
  weakness.name = what + AxisName(eigen.eigenvectors().col(2), parent_from_child, parent, child);
  return weakness;
}

std::vector<WeakDirection> FindWeakDirections(const Problem& problem, const Solution& solution) {
  const UnknownLayout& layout = solution.covariance.layout;
  const Eigen::MatrixXd& covariance = solution.covariance.matrix;
  constexpr double kWantedM = 1e-3;
  const double wanted_rad = DegToRad(0.1);
  constexpr double kWantedRatio = 0.002;
  const std::string camera_mount(CameraMountName(problem.setup));
  const std::string target_mount(TargetMountName(problem.setup));
  const Eigen::Index hand_eye = layout.Block(kHandEyeBlock).first;
  const Eigen::Index board = layout.Block(kBoardBlock).first;
  const Eigen::Matrix3d r_x = solution.hand_eye.camera_mount_from_camera.RotationMatrix();
  const Eigen::Matrix3d r_z = solution.hand_eye.target_mount_from_target.RotationMatrix();
  std::vector<WeakDirection> weak_directions = {
      WorstOf(covariance, hand_eye, "the camera's position along ", r_x, camera_mount, "camera"),
      WorstOf(covariance, hand_eye + 3, "the camera's orientation about ", r_x, camera_mount, "camera"),
      WorstOf(covariance, board, "the target's position along ", r_z, target_mount, "target"),
      WorstOf(covariance, board + 3, "the target's orientation about ", r_z, target_mount, "target")};
  for (size_t i = 0; i < weak_directions.size(); ++i) {
    const bool is_position = i % 2 == 0;
    weak_directions[i].wanted = is_position ? kWantedM : wanted_rad;
    weak_directions[i].unit = is_position ? "mm" : "deg";
    weak_directions[i].unit_size = is_position ? 1e-3 : DegToRad(1.0);
  }
  const UnknownBlock camera = layout.Block(kCameraBlock);
  for (Eigen::Index i = camera.first; i < camera.end(); ++i) {
    const Unknown& unknown = layout[i];
    const bool is_focal = unknown.group == UnknownGroup::kFocal;
    if (!is_focal && unknown.group != UnknownGroup::kPrincipalPoint) continue;
    WeakDirection weakness;
    weakness.name = layout.PlainName(i);
    weakness.direction = is_focal ? AxialFocalLengthByUnknowns(solution.camera, unknown.index, layout, camera)
                                  : Eigen::VectorXd::Unit(covariance.rows(), i);
    weakness.sigma = std::sqrt(weakness.direction.dot(covariance * weakness.direction));
    weakness.wanted = kWantedRatio * (is_focal ? AxialFocalLength(solution.camera, 0) : solution.camera.width_px);
    weakness.unit = "px";
    weak_directions.push_back(std::move(weakness));
  }
  weak_directions.erase(std::remove_if(weak_directions.begin(), weak_directions.end(),
                                       [](const WeakDirection& weakness) { return weakness.sigma <= weakness.wanted; }),
                        weak_directions.end());
  std::sort(weak_directions.begin(), weak_directions.end(),
            [](const WeakDirection& a, const WeakDirection& b) { return a.sigma / a.wanted > b.sigma / b.wanted; });
  return weak_directions;
}

// Two additional captures, by their motion and as linearised views.
struct SuggestedCaptures {
  std::string motion;
  std::vector<std::pair<std::string, double>> numbers;  // The size of the motion.
  std::vector<LinearisedView> views;
};

// Returns a view of all `points` from `camera_from_target`, or nothing if a point would lie outside the image.
std::optional<View> ImaginedView(const Problem& problem, const Solution& solution, const Observations& points,
                                 const Rigid3d& camera_from_target) {
  View view;
  view.camera_mount_from_target_mount = solution.hand_eye.camera_mount_from_camera * camera_from_target *
                                        Inverse(solution.hand_eye.target_mount_from_target);
  view.observations = points;
  view.observations.covariances_px2.clear();
  view.observations.whitening.clear();
  if (!Predict(solution.camera.Model(), solution.camera.params.data(), camera_from_target, points,
               &view.observations.pixels, nullptr)) {
    return std::nullopt;
  }
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = view.observations.pixels.col(i);
    if ((pixel.array() < 0).any() || pixel.x() > problem.camera.width_px || pixel.y() > problem.camera.height_px) {
      return std::nullopt;
    }
  }
  return view;
}

std::vector<SuggestedCaptures> FindSuggestedCaptures(const Problem& problem, const Solution& solution,
                                                     const FreeUnknowns& free) {
  const View& fullest = *std::max_element(problem.views.begin(), problem.views.end(), [](const View& a, const View& b) {
    return a.observations.size() < b.observations.size();
  });
  const Observations& points = fullest.observations;
  std::vector<Rigid3d> poses;
  for (const View& view : problem.views) {
    poses.push_back(CameraFromTarget(solution.hand_eye, CorrectedMount(problem.setup, view, solution)));
  }
  const Rigid3d mean = MeanPose(poses);
  const Eigen::Vector3d middle = points.points_in_target.rowwise().mean();
  // Rotates the mean pose about the centre of the points.
  const auto turned = [&](const Eigen::Vector3d& axis_in_target, double angle_rad) {
    const Rigid3d about(ExpRotation(angle_rad * axis_in_target), Eigen::Vector3d::Zero());
    return mean * Rigid3d(Eigen::Quaterniond::Identity(), middle) * about *
           Rigid3d(Eigen::Quaterniond::Identity(), -middle);
  };
  const auto moved = [&](const Eigen::Vector3d& by_m) { return Rigid3d(mean.rotation, mean.translation + by_m); };
  const double depth_m = (mean * middle).z();
  const double side_m = 0.25 * depth_m * problem.camera.width_px / solution.camera.params[0];
  struct Motion {
    std::string name;
    std::vector<std::pair<std::string, double>> numbers;
    std::function<Rigid3d(double)> pose;  // The pose for +1 or -1.
  };
  constexpr double kTiltDeg = 25;
  constexpr double kTurnDeg = 45;
  const double tilt_rad = DegToRad(kTiltDeg);
  const double turn_rad = DegToRad(kTurnDeg);
  const std::vector<Motion> motions = {
      {"tilt_about_x",
       {{"angle_deg", kTiltDeg}},
       [&](double side) { return turned(Eigen::Vector3d::UnitX(), side * tilt_rad); }},
      {"tilt_about_y",
       {{"angle_deg", kTiltDeg}},
       [&](double side) { return turned(Eigen::Vector3d::UnitY(), side * tilt_rad); }},
      {"rotate_in_plane",
       {{"angle_deg", kTurnDeg}},
       [&](double side) { return turned(Eigen::Vector3d::UnitZ(), side * turn_rad); }},
      {"nearer_and_farther",
       {{"distance_mm", 250 * depth_m}},
       [&](double side) { return moved(0.25 * side * depth_m * (mean * middle).normalized()); }},
      {"left_and_right",
       {},
       [&](double side) {
         return moved({side * side_m, 0, 0});
       }},
      {"top_and_bottom",
       {},
       [&](double side) {
         return moved({0, side * side_m, 0});
       }},
  };
  std::vector<SuggestedCaptures> cures;
  for (const Motion& motion : motions) {
    Problem imagined{solution.camera, {}, problem.setup, solution.shape};
    for (const double side : {1.0, -1.0}) {
      std::optional<View> view = ImaginedView(problem, solution, points, motion.pose(side));
      if (view) imagined.views.push_back(std::move(*view));
    }
    if (imagined.views.size() < 2) continue;
    std::optional<std::vector<LinearisedView>> views =
        LineariseViews(imagined, solution.hand_eye, {}, free, solution.pixel_sigma_px, LossOf(LossKind::kNone));
    if (views) cures.push_back({motion.name, motion.numbers, std::move(*views)});
  }
  return cures;
}

bool HasGroup(const std::vector<TargetShapeGroup>& shape, TargetShapeGroup group) {
  return std::find(shape.begin(), shape.end(), group) != shape.end();
}

// Returns a part for each group of a shape's parameters: `shape_scale`, `shape_bend`.
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
  return parts;
}

// Adds the largest change in sigmas among focal lengths and principal point: the name `intrinsic`, such as fx, and the
// numbers fx_px and fx_sigmas. Adds nothing if no sigma of these is known.
void AddLargestMove(const Camera& given, const Solution& solution, Finding* finding) {
  std::string largest;
  double by_px = 0;
  double sigmas = 0;
  for (size_t i = 0; i < 4; ++i) {
    const std::string& name = solution.camera.Model().param_names()[i];
    const std::optional<double> sigma = SigmaOf(solution.covariance, "camera." + name);
    const double move_px = solution.camera.params[i] - given.params[i];
    if (!sigma || (!largest.empty() && std::abs(move_px / *sigma) <= std::abs(sigmas))) continue;
    largest = name;
    by_px = move_px;
    sigmas = move_px / *sigma;
  }
  if (largest.empty()) return;
  finding->names.emplace_back("intrinsic", largest);
  finding->numbers.emplace_back(largest + "_px", by_px);
  finding->numbers.emplace_back(largest + "_sigmas", sigmas);
}

}  // namespace

std::optional<Finding> DiagnoseWeakDirections(const Problem& problem, const Solution& solution,
                                              const FreeUnknowns& free) {
  const UnknownLayout& layout = solution.covariance.layout;
  const std::vector<WeakDirection> weak_directions = FindWeakDirections(problem, solution);
  if (weak_directions.empty()) return std::nullopt;
  const std::vector<SuggestedCaptures> cures = FindSuggestedCaptures(problem, solution, free);
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  const Eigen::MatrixXd information =
      InvertInformation({layout, solution.covariance.matrix}, 1.0).matrix;  // The inverse of the covariance.
  const WeakDirection& worst = weak_directions.front();
  double best_sigma = std::numeric_limits<double>::infinity();
  const SuggestedCaptures* best = nullptr;
  for (const SuggestedCaptures& cure : cures) {
    const Information with{layout, information + MarginalInformation(cure.views, CorrectionVariances(robot), 1.0)};
    const Eigen::MatrixXd covariance = InvertInformation(with, 1.0).matrix;
    const double sigma = std::sqrt(worst.direction.dot(covariance * worst.direction));
    if (sigma >= best_sigma) continue;
    best_sigma = sigma;
    best = &cure;
  }
  Finding finding{Grade::kDoubtful, FindingCode("weak_direction")};
  for (const WeakDirection& weakness : weak_directions) {
    const double sigma = weakness.sigma / weakness.unit_size;
    finding.numbers.emplace_back(weakness.name + ", " + weakness.unit, sigma);
    finding.parts.push_back({Grade::kDoubtful,
                             FindingCode("weak_direction_of"),
                             {{"sigma", sigma}},
                             {{"direction", weakness.name}, {"unit", weakness.unit}}});
  }
  constexpr double kHelps = 0.85;
  if (best != nullptr && best_sigma < kHelps * worst.sigma) {
    Finding suggested{Grade::kGood, FindingCode("suggested_captures"), best->numbers};
    suggested.numbers.emplace_back("sigma", best_sigma / worst.unit_size);
    suggested.names = {{"motion", best->motion},
                       {"moved", problem.setup == Setup::kEyeToHand ? "target" : "camera"},
                       {"direction", worst.name},
                       {"unit", worst.unit}};
    finding.parts.push_back(std::move(suggested));
  }
  return finding;
}

Finding DescribeModel(const ErrorModel& chosen, const std::vector<ModelAlternative>& alternatives,
                      const Solution& solution) {
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

std::vector<Finding> DiagnoseModel(const Problem& problem, const Solution& solution, const BundleOptions& options,
                                   const AutoModel& chosen) {
  const bool asks_robot = !chosen.robot_noise && options.robot == BundleOptions::Robot::kExact;
  const bool asks_shape = !chosen.target_shape && options.free_shape.empty();
  constexpr size_t kMinCaptures = 6;
  if ((!asks_robot && !asks_shape) || problem.views.size() < kMinCaptures) return {};
  Problem at = problem;
  at.camera = solution.camera;
  BundleOptions kept = options;
  kept.loss = InlierLoss(options).kind;
  const Outcome<ModelChoice> choice = ChooseModel(at, solution.hand_eye, kept, {true, asks_shape});
  if (!choice || choice->alternatives.empty()) return {};
  const ErrorModel& model = choice->alternatives[choice->chosen].model;
  std::vector<Finding> findings;
  if (asks_shape && !model.shape.empty()) {
    constexpr double kScaleMatters = 3e-4;
    constexpr double kBendMattersM = 1e-4;
    const TargetShape& shape = choice->solution.shape;
    const double scale = std::max(std::abs(shape.params[0] - 1), std::abs(shape.params[1] - 1));
    const double bend_m = std::max(std::abs(shape.params[2]), std::abs(shape.params[3]));
    if (scale > kScaleMatters || bend_m > kBendMattersM) {
      const bool is_held = std::find(options.free_intrinsics.begin(), options.free_intrinsics.end(),
                                     ParameterGroup::kFocal) == options.free_intrinsics.end();
      Finding& ignored = findings.emplace_back(Finding{Grade::kDoubtful, FindingCode("target_shape_ignored")});
      ignored.numbers = {{"scale_x", shape.params[0]},
                         {"scale_y", shape.params[1]},
                         {"bend_x_mm", 1000 * shape.params[2]},
                         {"bend_y_mm", 1000 * shape.params[3]}};
      ignored.names = {{"focal_length", is_held ? "held" : "free"}};
      ignored.parts = ShapeParts(shape, model.shape);
    }
  }
  if (asks_robot && choice->solution.robot_noise && model.robot != BundleOptions::Robot::kExact) {
    const RobotNoise& noise = *choice->solution.robot_noise;
    findings.push_back({Grade::kDoubtful,
                        FindingCode("robot_noise_ignored"),
                        {{"robot_mm", 1000 * noise.translation_m}, {"robot_deg", RadToDeg(noise.rotation_rad)}}});
  }
  return findings;
}

std::optional<Finding> DiagnoseScale(const Solution& solution, const ErrorModel& model) {
  if (!HasGroup(model.shape, TargetShapeGroup::kScale)) return std::nullopt;
  return JudgeScale(solution.shape, !SigmaOf(solution.covariance, "camera.fx"));
}

std::optional<Finding> JudgeScale(const TargetShape& shape, bool is_focal_held) {
  constexpr double kOfPrint = 5e-3;
  constexpr double kWrong = 0.02;
  const double off = std::max(std::abs(shape.params[0] - 1), std::abs(shape.params[1] - 1));
  if (off <= kOfPrint) return std::nullopt;
  Finding finding{off > kWrong ? Grade::kBad : Grade::kDoubtful,
                  FindingCode("target_scale"),
                  {{"scale_x", shape.params[0]}, {"scale_y", shape.params[1]}},
                  {{"focal_length", is_focal_held ? "held" : "free"}}};
  finding.is_cause = true;
  return finding;
}

std::optional<Finding> DiagnoseHeldIntrinsics(const Problem& problem, const Solution& solution,
                                              const BundleOptions& options_in, const AutoModel& choose) {
  if (!options_in.free_intrinsics.empty()) return std::nullopt;
  BundleOptions options = options_in;
  options.free_intrinsics = BundleOptions().free_intrinsics;
  options.loss = InlierLoss(options).kind;
  Problem at = problem;
  at.camera = solution.camera;
  at.shape = solution.shape;
  // The best error model may be another one with free intrinsics.
  const Outcome<ModelChoice> choice = ChooseModel(at, solution.hand_eye, options, choose);
  if (!choice) return std::nullopt;
  const Solution& freed = choice->solution;
  const UnknownBlock camera = freed.covariance.layout.Block(kCameraBlock);
  const Eigen::Index num_intrinsics = camera.size;
  CHECK_EQ(num_intrinsics, NumParams(solution.camera.Model()));
  const Eigen::MatrixXd covariance =
      freed.covariance.matrix.block(camera.first, camera.first, num_intrinsics, num_intrinsics);
  Eigen::VectorXd difference(num_intrinsics);
  for (Eigen::Index i = 0; i < num_intrinsics; ++i) {
    const auto k = static_cast<size_t>(i);
    difference[i] = freed.camera.params[k] - solution.camera.params[k];
  }
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::VectorXd scaled = scale.cwiseProduct(difference);
  const double squares = scaled.dot((scale.asDiagonal() * covariance * scale.asDiagonal()).ldlt().solve(scaled));
  const double dof = static_cast<double>(num_intrinsics);
  constexpr double kBeyondDoubt = 1e-4;
  const double p = FisherTail(std::max(0.0, squares) / dof, dof, freed.covariance_dof);
  if (!(p < kBeyondDoubt)) return std::nullopt;
  const double move_m = DistanceM(solution.hand_eye.camera_mount_from_camera, freed.hand_eye.camera_mount_from_camera);
  const double move_rad = AngleRad(solution.hand_eye.camera_mount_from_camera, freed.hand_eye.camera_mount_from_camera);
  constexpr double kBadM = 5e-3;
  const double bad_rad = DegToRad(0.5);
  Finding finding{move_m > kBadM || move_rad > bad_rad ? Grade::kBad : Grade::kDoubtful,
                  FindingCode("held_intrinsics")};
  AddLargestMove(solution.camera, freed, &finding);
  finding.numbers.emplace_back("move_mm", 1000 * move_m);
  finding.numbers.emplace_back("move_deg", RadToDeg(move_rad));
  finding.numbers.emplace_back("p", p);
  finding.is_cause = true;
  return finding;
}

Finding DescribeCameraUse(const Camera& given, const Solution& solution, const BundleOptions& options) {
  Finding finding{Grade::kGood, FindingCode("camera")};
  if (options.free_intrinsics.empty()) {
    finding.names = {{"use", "held"}};
    return finding;
  }
  finding.names = {{"use", options.camera_prior ? "prior" : "initial_guess"}};
  AddLargestMove(given, solution, &finding);
  return finding;
}

}  // namespace heba
