#include "heba/session_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/initial/target_pose.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kFalseAlarms = 0.05;
constexpr double kSeen = 0.95;
constexpr int kNumDraws = 4000;
// A lens is found to have changed from this probability on, and if it moves the points by so many sigmas of a pixel
// (RMS): what the calibration's model of lens and target lacks is the same in many points, and smaller. The scale of a
// target must change by more than errors of a robot's lengths.
constexpr double kLensP = 1e-6;
constexpr double kLeastLensShift = 2;
constexpr double kLeastScaleChange = 0.01;

// The residuals of all images at the calibration, whitened by everything that scatters them if nothing has changed, and
// their derivatives by the unknowns.
struct WhitenedSession {
  UnknownLayout layout;
  Eigen::MatrixXd by_unknowns;
  Eigen::VectorXd residuals;
};

// Returns the points of an image without those that contradict the others: misread ones, which a calibration would
// reject, too. They are judged by the pose of the target that fits this image best, with the larger of the noise of the
// calibration and that of their median, so that a lens that has changed makes no outliers. Returns all points if that
// pose is not known or more than a fifth contradict it.
Observations WithoutMisreadPoints(const Camera& camera, const TargetShape& shape, double sigma_px,
                                  const Observations& points) {
  constexpr int kMostSteps = 5;
  constexpr double kLeastKept = 0.8;
  constexpr int kFewestPoints = 6;
  std::vector<bool> keep(static_cast<size_t>(points.size()), true);
  for (int step = 0; step < kMostSteps; ++step) {
    const auto num_kept = static_cast<int>(std::count(keep.begin(), keep.end(), true));
    if (num_kept < std::max(kFewestPoints, static_cast<int>(std::ceil(kLeastKept * points.size())))) return points;
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, ApplyShape(KeepPoints(points, keep), shape));
    if (poses.empty()) return points;
    const Rigid3d& pose = poses.front().camera_from_target;
    const Observations shaped = ApplyShape(points, shape);
    const std::optional<std::vector<double>> squares =
        WhitenedSquares(camera.Model(), camera.params.data(), pose, shaped, nullptr);
    if (!squares) return points;
    const std::vector<bool> inliers = FindInliers(camera, pose, shaped, std::max(sigma_px, SigmaFromMedian(*squares)));
    if (inliers == keep) return KeepPoints(points, keep);
    keep = inliers;
  }
  return points;
}

// Returns the covariance of the unknowns of a layout, of which the calibration may know fewer: what it does not know is
// held.
Eigen::MatrixXd CovarianceIn(const UnknownLayout& layout, const Covariance& known) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(layout.size(), layout.size());
  std::vector<Eigen::Index> places;
  std::vector<Eigen::Index> of_known;
  for (Eigen::Index i = 0; i < layout.size(); ++i) {
    const std::optional<Eigen::Index> place = known.layout.Place(layout.Name(i));
    if (!place) continue;
    places.push_back(i);
    of_known.push_back(*place);
  }
  covariance(places, places) = known.matrix(of_known, of_known);
  return covariance;
}

// Returns a covariance with the wobble of what grippers carry.
Eigen::MatrixXd WithWobble(Eigen::MatrixXd covariance, const Problem& problem, const UnknownLayout& layout,
                           const RobotNoise& wobble) {
  const Tangent6 variances = CorrectionVariances(wobble);
  const auto add = [&](const Mount& mount, const std::string& block) {
    const Eigen::Index first = layout.Block(block).first;
    if (mount.part == Mount::Part::kGripper) covariance.diagonal().segment<6>(first) += variances;
  };
  for (const ProblemCamera& camera : problem.cameras) add(camera.mount, CameraPoseBlock(camera));
  for (const ProblemTarget& target : problem.targets) add(target.mount, TargetPoseBlock(target));
  return covariance;
}

// Returns the covariance of the rows of all views with that which the smooth errors of the arms cause. `first_rows` are
// the places of the views.
Eigen::MatrixXd WithSmoothErrors(Eigen::MatrixXd covariance, const Problem& problem, const SessionOptions& options,
                                 const std::vector<LinearisedView>& views,
                                 const std::vector<Eigen::Index>& first_rows) {
  const std::vector<size_t> captures = CapturesWithPoints(problem);
  const std::vector<size_t> moving = MovingRobots(problem);
  for (size_t k = 0; k < moving.size(); ++k) {
    if (options.smooth.empty() || !options.smooth[moving[k]]) continue;
    const SmoothPrior& prior = *options.smooth[moving[k]];
    std::vector<Rigid3d> poses;
    for (const size_t i : captures) poses.push_back(problem.captures[i].base_from_gripper[moving[k]]);
    SmoothErrors errors(poses, prior.lengths);
    errors.SetSigmas({prior.sigma.translation_m, prior.sigma.rotation_rad});
    const SharedEffects& effects = errors.effects();
    Eigen::VectorXd sigmas(effects.size());
    for (Eigen::Index j = 0; j < sigmas.size(); ++j) {
      sigmas[j] = effects.groups[effects.effects[static_cast<size_t>(j)].group].sigma;
    }
    Eigen::MatrixXd by_effects(covariance.rows(), sigmas.size());
    for (size_t v = 0; v < views.size(); ++v) {
      by_effects.middleRows(first_rows[v], views[v].offset.size()) =
          views[v].by_effects.middleCols<6>(6 * static_cast<Eigen::Index>(k)) * errors.GripperByEffects(poses[v]) *
          sigmas.asDiagonal();
    }
    covariance += by_effects * by_effects.transpose();
  }
  return covariance;
}

WhitenedSession Whiten(const Problem& problem, const Solution& solution, const SessionOptions& options,
                       const std::vector<LinearisedView>& views) {
  const Eigen::VectorXd variances =
      CorrectionVariances(NoiseOf(solution), NoisyJointsOf(problem, MovingRobots(problem)));
  WhitenedSession session{UnknownsOf(problem), {}, {}};
  std::vector<Eigen::Index> first_rows;
  Eigen::Index num_rows = 0;
  for (const LinearisedView& view : views) {
    first_rows.push_back(num_rows);
    num_rows += view.offset.size();
  }
  session.by_unknowns.resize(num_rows, session.layout.size());
  session.residuals.resize(num_rows);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(num_rows, num_rows);
  for (size_t v = 0; v < views.size(); ++v) {
    const Eigen::Index size = views[v].offset.size();
    session.by_unknowns.middleRows(first_rows[v], size) = views[v].by_unknowns;
    session.residuals.segment(first_rows[v], size) = views[v].offset;
    covariance.block(first_rows[v], first_rows[v], size, size) = MarginalCovariance(views[v], 1, variances);
  }
  covariance = WithSmoothErrors(std::move(covariance), problem, options, views, first_rows);
  const Covariance& known =
      solution.covariance_repeatable.matrix.size() > 0 ? solution.covariance_repeatable : solution.covariance;
  const Eigen::MatrixXd of_unknowns =
      WithWobble(CovarianceIn(session.layout, known), problem, session.layout, options.wobble);
  covariance += session.by_unknowns * of_unknowns * session.by_unknowns.transpose();
  const auto factor = Cholesky(covariance);
  CHECK(factor.has_value()) << "the noise of the pixels makes the covariance positive";
  session.by_unknowns = factor->SolveLower(session.by_unknowns);
  session.residuals = factor->SolveLower(session.residuals);
  return session;
}

// One part in the whitened rows, without what another pose of moved targets explains.
struct TestedPart {
  SessionChange change;
  Eigen::Index first = 0;  // Among the columns of all tested parts.
  Eigen::Index size = 0;
  bool has_pose = true;  // Whether the first six columns are those of its pose.
  Eigen::MatrixXd inverse_information;
};

// Returns d^T C^-1 d for the products of a part's columns with residuals.
double SquareOf(const TestedPart& part, const Eigen::VectorXd& products) {
  const auto own = products.segment(part.first, part.size);
  return own.dot(part.inverse_information * own);
}

double PValueOf(const TestedPart& part, const Eigen::VectorXd& products, double scale, double dof) {
  const auto size = static_cast<double>(part.size);
  return FisherTail(std::max(0.0, SquareOf(part, products)) / (size * scale), size, dof);
}

// Draws of the products of all columns with residuals that nothing has changed, and of the ratio of the noise to its
// estimate.
struct Draws {
  Eigen::MatrixXd products;  // One column per draw.
  Eigen::VectorXd scales;
};

Draws DrawUnchanged(const Eigen::MatrixXd& information, double dof) {
  const Eigen::Index size = information.rows();
  const SymmetricEigen<Eigen::Dynamic> eigen = EigenOfSymmetric(information);
  const Eigen::MatrixXd root = eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal();
  std::mt19937_64 random(1);  // NOLINT(cert-msc32-c,cert-msc51-cpp): results are to be repeatable.
  std::normal_distribution<double> normal;
  Draws draws{Eigen::MatrixXd(size, kNumDraws), Eigen::VectorXd::Ones(kNumDraws)};
  for (Eigen::Index k = 0; k < kNumDraws; ++k) {
    Eigen::VectorXd standard(size);
    for (double& value : standard) value = normal(random);
    draws.products.col(k) = root * standard;
  }
  if (!std::isfinite(dof)) return draws;
  std::chi_squared_distribution<double> chi_squared(dof);
  for (double& scale : draws.scales) scale = chi_squared(random) / dof;
  return draws;
}

// Returns the size of changes of a pose, of its translation or of its rotation alone in random directions, of which a
// share kSeen is found; `critical` is the p-value of a part from which on a change is found.
double SizeSeen(const std::vector<TestedPart>& parts, const TestedPart& moved, bool is_rotation,
                const Eigen::MatrixXd& information, const Draws& draws, double critical, double dof) {
  std::mt19937_64 random(2);  // NOLINT(cert-msc32-c,cert-msc51-cpp): results are to be repeatable.
  std::normal_distribution<double> normal;
  std::vector<double> limits;
  for (const TestedPart& part : parts) {
    const auto size = static_cast<double>(part.size);
    limits.push_back(size * FisherQuantile(critical, size, dof));
  }
  const Eigen::MatrixXd by_change = information.middleCols(moved.first + (is_rotation ? 3 : 0), 3);
  Eigen::MatrixXd shifts(information.rows(), draws.products.cols());
  for (Eigen::Index k = 0; k < shifts.cols(); ++k) {
    const Eigen::Vector3d direction{normal(random), normal(random), normal(random)};
    shifts.col(k) = by_change * direction.normalized();
  }
  const auto share_found = [&](double size) {
    int num_found = 0;
    for (Eigen::Index k = 0; k < shifts.cols(); ++k) {
      const Eigen::VectorXd products = draws.products.col(k) + size * shifts.col(k);
      for (size_t b = 0; b < parts.size(); ++b) {
        if (SquareOf(parts[b], products) <= limits[b] * draws.scales[k]) continue;
        ++num_found;
        break;
      }
    }
    return static_cast<double>(num_found) / static_cast<double>(shifts.cols());
  };
  constexpr double kLeast = 1e-9;
  constexpr double kMost = 10;
  double low = kLeast;
  double high = kMost;
  for (int k = 0; k < 36 && high > 1.001 * low; ++k) {
    const double middle = std::sqrt(low * high);
    (share_found(middle) < kSeen ? low : high) = middle;
  }
  return high;
}

// Parts, with their columns in WhitenedSession::by_unknowns.
struct TestedParts {
  std::vector<TestedPart> parts;
  std::vector<Eigen::Index> columns;
};

// Returns the parts that the images may tell, changes of poses alone before the others. Without `has_targets`, the
// poses of the targets are not those of parts.
TestedParts PartsOf(const Problem& problem, const UnknownLayout& layout, bool has_targets) {
  TestedParts tested;
  const UnknownBlock none;
  const auto add = [&](ChangedPart kind, size_t index, const UnknownBlock& pose, const UnknownBlock& params) {
    if (pose.size + params.size == 0 || (!IsMoved(kind) && params.size == 0)) return;
    TestedPart& part = tested.parts.emplace_back();
    part.change.part = kind;
    part.change.index = index;
    part.first = static_cast<Eigen::Index>(tested.columns.size());
    part.size = pose.size + params.size;
    part.has_pose = pose.size > 0;
    for (const UnknownBlock& block : {pose, params}) {
      for (Eigen::Index i = block.first; i < block.end(); ++i) tested.columns.push_back(i);
    }
  };
  const auto pose_of = [&](const ProblemTarget& target) {
    return has_targets ? layout.Block(TargetPoseBlock(target)) : none;
  };
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    add(ChangedPart::kCamera, c, layout.Block(CameraPoseBlock(problem.cameras[c])), none);
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) add(ChangedPart::kTarget, t, pose_of(problem.targets[t]), none);
  for (size_t r = 1; r < problem.robots.size(); ++r) {
    add(ChangedPart::kBase, r, layout.Block(BaseBlock(problem.robots[r])), none);
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const UnknownBlock lens = layout.Block(CameraBlock(problem.cameras[c]));
    add(ChangedPart::kLens, c, none, lens);
    add(ChangedPart::kExchangedCamera, c, layout.Block(CameraPoseBlock(problem.cameras[c])), lens);
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const ProblemTarget& target = problem.targets[t];
    UnknownBlock scales = layout.Block(TargetShapeBlock(target));
    const auto& free = target.free_shape;
    if (std::find(free.begin(), free.end(), TargetShapeGroup::kScale) == free.end()) continue;
    scales.size = NumParamsOf(TargetShapeGroup::kScale);
    add(ChangedPart::kExchangedTarget, t, pose_of(target), scales);
  }
  return tested;
}

// Returns which poses are those of the parts of a kind.
std::vector<Rigid3d> CellPoses::*PosesOf(ChangedPart kind) {
  switch (kind) {
    case ChangedPart::kTarget:
    case ChangedPart::kExchangedTarget:
      return &CellPoses::mount_from_target;
    case ChangedPart::kBase:
      return &CellPoses::world_from_base;
    case ChangedPart::kCamera:
    case ChangedPart::kLens:
    case ChangedPart::kExchangedCamera:
      break;
  }
  return &CellPoses::mount_from_camera;
}

// Returns the parameters of a part that has some.
Eigen::VectorXd ParamsOf(const SessionChange& part, const Solution& solution) {
  if (part.part == ChangedPart::kExchangedTarget) {
    return Eigen::VectorXd::Map(solution.shapes[part.index].params.data(), NumParamsOf(TargetShapeGroup::kScale));
  }
  const std::vector<double>& params = solution.cameras[part.index].params;
  return Eigen::VectorXd::Map(params.data(), static_cast<Eigen::Index>(params.size()));
}

// Returns the solution with a part that has changed, its pose before its parameters.
Solution Changed(Solution solution, const TestedPart& part, const Eigen::VectorXd& change) {
  const size_t index = part.change.index;
  if (part.has_pose) {
    Rigid3d& pose = (solution.poses.*PosesOf(part.change.part))[index];
    pose = Retract(pose, Tangent6(change.head<6>()));
  }
  const Eigen::Index num_params = change.size() - (part.has_pose ? 6 : 0);
  if (num_params == 0) return solution;
  const Eigen::VectorXd params = ParamsOf(part.change, solution) + change.tail(num_params);
  const bool is_target = part.change.part == ChangedPart::kExchangedTarget;
  std::copy(params.begin(), params.end(),
            is_target ? solution.shapes[index].params.data() : solution.cameras[index].params.data());
  return solution;
}

// Returns the inverse information of a part; nothing if the images do not determine its change. `squares` are those of
// the columns, with what another pose of moved targets explains.
std::optional<Eigen::MatrixXd> InverseInformation(const TestedPart& part, const Eigen::MatrixXd& information,
                                                  const Eigen::VectorXd& squares) {
  const Eigen::MatrixXd own = information.block(part.first, part.first, part.size, part.size);
  const Eigen::VectorXd scale = squares.segment(part.first, part.size).cwiseSqrt();
  if (!(scale.minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd inverse = scale.cwiseInverse();
  const Eigen::MatrixXd scaled = inverse.asDiagonal() * own * inverse.asDiagonal();
  constexpr double kNothing = 1e-9;
  if (!(EigenOfSymmetric(scaled).values.minCoeff() > kNothing)) return std::nullopt;
  return inverse.asDiagonal() * InverseOfSymmetric(scaled) * inverse.asDiagonal();
}

// The images at an estimate. `moved` are the columns of targets that were moved: `tested` and `residuals` are without
// what these explain.
struct Evaluated {
  std::vector<LinearisedView> views;
  UnknownLayout layout;
  Eigen::MatrixXd all_tested;  // The columns of all parts.
  Eigen::VectorXd all_residuals;
  Eigen::MatrixXd moved;
  Eigen::MatrixXd tested;
  Eigen::VectorXd residuals;
};

// Returns nothing if a point cannot be projected.
std::optional<Evaluated> EvaluateAt(const Problem& problem, const Solution& at, const SessionOptions& options,
                                    const std::vector<Eigen::Index>& columns) {
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(problem, StateOf(at), NoiseOf(at), LossOf(LossKind::kNone));
  if (!views) return std::nullopt;
  WhitenedSession session = Whiten(problem, at, options, *views);
  Evaluated evaluated{std::move(*views),
                      std::move(session.layout),
                      session.by_unknowns(Eigen::all, columns),
                      std::move(session.residuals),
                      {},
                      {},
                      {}};
  evaluated.tested = evaluated.all_tested;
  evaluated.residuals = evaluated.all_residuals;
  if (options.is_target_in_place) return evaluated;
  std::vector<Eigen::Index> of_targets;
  for (const ProblemTarget& target : problem.targets) {
    const UnknownBlock block = evaluated.layout.Block(TargetPoseBlock(target));
    for (Eigen::Index i = block.first; i < block.end(); ++i) of_targets.push_back(i);
  }
  evaluated.moved = session.by_unknowns(Eigen::all, of_targets);
  const Eigen::MatrixXd products = evaluated.moved.transpose() * evaluated.moved;
  evaluated.tested -= evaluated.moved * SolveSymmetric(products, evaluated.moved.transpose() * evaluated.all_tested);
  evaluated.residuals -=
      evaluated.moved * SolveSymmetric(products, evaluated.moved.transpose() * evaluated.all_residuals);
  return evaluated;
}

// Returns the step of the poses of moved targets to where they explain these residuals best; empty if none was moved.
Eigen::VectorXd StepOfTargets(const Evaluated& at, const Eigen::VectorXd& residuals) {
  if (at.moved.cols() == 0) return {};
  return SolveSymmetric(at.moved.transpose() * at.moved, at.moved.transpose() * residuals);
}

Solution Stepped(Solution solution, const Eigen::VectorXd& step) {
  for (size_t t = 0; step.size() > 0 && t < solution.poses.mount_from_target.size(); ++t) {
    Rigid3d& pose = solution.poses.mount_from_target[t];
    pose = Retract(pose, step.segment<6>(6 * static_cast<Eigen::Index>(t)));
  }
  return solution;
}

// Returns the solution with the poses of its targets as the images show them: from the pose that most images agree with
// to the one of least squares.
Solution WithTargetsPlaced(const Problem& problem, Solution solution, const SessionOptions& options) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    std::vector<Rigid3d> candidates;
    for (const ProblemCapture& capture : problem.captures) {
      for (const ProblemImage& image : capture.images) {
        if (image.target != t) continue;
        const std::vector<Rigid3d> base_from_gripper = WithErrors(capture, solution.effects);
        const ProblemCamera& camera = problem.cameras[image.camera];
        const std::vector<Rigid3d>& bases = solution.poses.world_from_base;
        const Rigid3d world_from_camera =
            WorldFromMount(camera.mount, bases, base_from_gripper) * solution.poses.mount_from_camera[image.camera];
        const Rigid3d mount_from_world = Inverse(WorldFromMount(problem.targets[t].mount, bases, base_from_gripper));
        for (const TargetPose& pose :
             EstimateTargetPose(solution.cameras[image.camera], ApplyShape(image.observations, solution.shapes[t]))) {
          candidates.push_back(mount_from_world * world_from_camera * pose.camera_from_target);
        }
      }
    }
    // The one with the least sum of distances to the others; a radian counts as much as the target is far.
    double least = std::numeric_limits<double>::infinity();
    Rigid3d best = solution.poses.mount_from_target[t];
    for (const Rigid3d& candidate : candidates) {
      double sum = 0;
      for (const Rigid3d& other : candidates) {
        constexpr double kMost = 0.1;
        sum += std::min(kMost, DistanceM(candidate, other) + AngleRad(candidate, other));
      }
      if (sum >= least) continue;
      least = sum;
      best = candidate;
    }
    solution.poses.mount_from_target[t] = best;
  }
  constexpr int kMostSteps = 8;
  constexpr double kSmall = 1e-7;
  for (int step = 0; step < kMostSteps; ++step) {
    const std::optional<Evaluated> at = EvaluateAt(problem, solution, options, {});
    if (!at) break;
    const Eigen::VectorXd to_best = StepOfTargets(*at, at->all_residuals);
    solution = Stepped(std::move(solution), to_best);
    if (to_best.norm() < kSmall) break;
  }
  return solution;
}

// The best change of one part alone.
struct FittedChange {
  Solution solution;
  Eigen::MatrixXd covariance;
  double squares = 0;  // The sum of the squares of the whitened residuals that are left.
};

// Changes the part until the images ask for no more. Returns nothing if its change is not determined.
std::optional<FittedChange> FitChange(const Problem& problem, const Solution& start, const SessionOptions& options,
                                      const std::vector<Eigen::Index>& columns, const TestedPart& part) {
  std::optional<FittedChange> fitted;
  Solution at = start;
  constexpr int kMostSteps = 8;
  constexpr double kSmall = 1e-7;
  for (int step = 0; step <= kMostSteps; ++step) {
    const std::optional<Evaluated> evaluated = EvaluateAt(problem, at, options, columns);
    if (!evaluated) break;
    const Eigen::MatrixXd own = evaluated->tested.middleCols(part.first, part.size);
    const Eigen::MatrixXd information = own.transpose() * own;
    const Eigen::VectorXd change = SolveSymmetric(information, own.transpose() * evaluated->residuals);
    const double squares = (evaluated->residuals - own * change).squaredNorm();
    if (!std::isfinite(squares) || !change.allFinite()) break;
    if (fitted && squares > 1.5 * fitted->squares + 1) break;  // It diverges.
    at = Changed(std::move(at), part, change);
    const Eigen::VectorXd left =
        evaluated->all_residuals - evaluated->all_tested.middleCols(part.first, part.size) * change;
    at = Stepped(std::move(at), StepOfTargets(*evaluated, left));
    fitted = FittedChange{at, InverseOfSymmetric(information), squares};
    const Eigen::VectorXd scaled = change.cwiseProduct(information.diagonal().cwiseSqrt());
    if (scaled.norm() < kSmall + 1e-3) break;
  }
  return fitted;
}

// Returns the change of a part from the calibration to a solution: the tangent of a pose that has changed alone, or the
// difference of the parameters.
Eigen::VectorXd ChangeTo(const Solution& calibration, const Solution& solution, const SessionChange& part) {
  if (!IsMoved(part.part)) return ParamsOf(part, solution) - ParamsOf(part, calibration);
  const auto poses = PosesOf(part.part);
  return LocalCoordinates((calibration.poses.*poses)[part.index], (solution.poses.*poses)[part.index]);
}

// Returns by how many sigmas of a pixel a change of a lens moves the points (RMS).
double LensShift(const Problem& problem, const Evaluated& at, const SessionChange& lens) {
  const UnknownBlock block = at.layout.Block(CameraBlock(problem.cameras[lens.index]));
  double squares = 0;
  for (const LinearisedView& view : at.views) {
    squares += (view.by_unknowns.middleCols(block.first, block.size) * lens.change).squaredNorm();
  }
  double num_points = 0;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.camera == lens.index) num_points += image.observations.size();
    }
  }
  return num_points > 0 ? std::sqrt(squares / (2 * num_points)) : 0;
}

// The mean square of the points' residuals about the best pose of the target in each image, in units of their noise,
// and its degrees of freedom.
struct Scatter {
  double mean_square = 0;
  double dof = 0;  // 0 if no image has more points than a pose needs.
};

Scatter ScatterOf(const Problem& problem, const Solution& solution) {
  double squares = 0;
  double number = 0;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      constexpr int kPoseParams = 6;
      const Observations points = ApplyShape(image.observations, solution.shapes[image.target]);
      if (2 * points.size() <= kPoseParams) continue;
      const std::vector<TargetPose> poses = EstimateTargetPose(solution.cameras[image.camera], points);
      if (poses.empty()) continue;
      const std::optional<SquaredErrors> errors =
          ViewErrors(solution.cameras[image.camera], poses.front().camera_from_target, points);
      const double rms_px = errors ? errors->RmsPx().value_or(0) : 0;
      const double sigma_px = solution.pixel_sigmas_px[image.camera];
      squares += points.size() * rms_px * rms_px / (sigma_px * sigma_px);
      number += 2 * points.size() - kPoseParams;
    }
  }
  return number > 0 ? Scatter{squares / number, number} : Scatter();
}

// A change that was fitted, with the sum of the squares that it leaves.
struct RankedChange {
  double squares = 0;
  double num_unknowns = 0;
  SessionChange change;

  double Rank() const { return squares + 2 * num_unknowns; }  // Akaike's criterion: the least is the most likely.
};

// Returns whether a lens, or the scales of a target, have changed by more than what models lack.
bool IsLargeChange(const Problem& problem, const Evaluated& at, const SessionChange& change) {
  if (change.part == ChangedPart::kExchangedTarget) return change.change.cwiseAbs().maxCoeff() > kLeastScaleChange;
  return LensShift(problem, at, change) >= kLeastLensShift;
}

// Returns a check with the changes of the poses that fit best in place of the linear ones, the `others` that have
// changed beyond doubt, and what is left unexplained.
SessionCheck WithFittedChanges(SessionCheck check, const Problem& problem, const Solution& calibration,
                               const Solution& start, const SessionOptions& options,
                               const std::vector<Eigen::Index>& columns, const Evaluated& at_start,
                               const std::vector<TestedPart>& parts, const std::vector<TestedPart>& others) {
  const double dof = calibration.covariance_dof;
  std::vector<RankedChange> ranked;
  const auto add = [&](const TestedPart& part, SessionChange change) {
    const std::optional<FittedChange> fitted = FitChange(problem, start, options, columns, part);
    if (!fitted) return;
    change.change = ChangeTo(calibration, fitted->solution, change);
    change.covariance = fitted->covariance;
    ranked.push_back({fitted->squares, static_cast<double>(part.size), std::move(change)});
  };
  for (size_t i = 0; i < parts.size(); ++i) add(parts[i], check.changes[i]);
  const auto by_rank = [](const RankedChange& a, const RankedChange& b) { return a.Rank() < b.Rank(); };
  std::stable_sort(ranked.begin(), ranked.end(), by_rank);
  const double best = ranked.empty() ? at_start.residuals.squaredNorm() : ranked.front().Rank();
  for (const TestedPart& part : others) {
    const std::optional<FittedChange> fitted = FitChange(problem, start, options, columns, part);
    if (!fitted) continue;
    SessionChange other = part.change;
    other.change = ChangeTo(calibration, fitted->solution, other);
    const Eigen::Index num_params = other.change.size();
    other.covariance = fitted->covariance.bottomRightCorner(num_params, num_params);
    const auto size = static_cast<double>(part.size);
    const double gain = std::max(0.0, at_start.residuals.squaredNorm() - fitted->squares);
    other.p_value = FisherTail(gain / size, size, dof);
    constexpr double kDecisive = 20;
    if (other.p_value >= kLensP || !IsLargeChange(problem, at_start, other)) continue;
    if (fitted->squares + 2 * size > best - kDecisive) continue;
    check.has_changed = true;
    check.p_value = std::min(check.p_value, other.p_value);
    ranked.push_back({fitted->squares, size, std::move(other)});
  }
  if (ranked.empty()) return check;
  std::stable_sort(ranked.begin(), ranked.end(), by_rank);
  check.changes.clear();
  for (RankedChange& one : ranked) {
    one.change.rank = one.Rank();
    check.changes.push_back(std::move(one.change));
  }
  const double left =
      static_cast<double>(at_start.residuals.size() - at_start.moved.cols()) - ranked.front().num_unknowns;
  if (left <= 0) return check;
  const double squares = ranked.front().squares;
  check.unexplained_ratio = std::sqrt(std::max(0.0, squares) / left);
  check.unexplained_p_value = FisherTail(std::max(0.0, squares) / left, left, dof);
  return check;
}

// How much of a check is wanted: whether any pose has changed, or also what, and what would have been seen.
enum class CheckExtent { kDecision, kAll };

// Tests all captures together, as CheckSession.
Outcome<SessionCheck> CheckCaptures(const Problem& problem_in, const Solution& solution, const SessionOptions& options,
                                    CheckExtent extent) {
  Solution calibration = solution;
  calibration.unmodelled_sigma_px.resize(problem_in.cameras.size());  // A file does not have them.
  constexpr double kLeastPx = 1e-6;                                   // A file may state an exact camera.
  for (double& sigma_px : calibration.pixel_sigmas_px) sigma_px = std::max(sigma_px, kLeastPx);
  Problem problem = WeightedAs(calibration, problem_in);
  SessionCheck check;
  for (ProblemCapture& capture : problem.captures) {
    std::set<size_t> cameras;
    for (ProblemImage& image : capture.images) {
      cameras.insert(image.camera);
      image.observations = WithoutMisreadPoints(calibration.cameras[image.camera], calibration.shapes[image.target],
                                                calibration.pixel_sigmas_px[image.camera], image.observations);
    }
    check.num_images += static_cast<int>(cameras.size());
  }
  if (CapturesWithPoints(problem).empty()) return Failure{FailureCode("no_target")};
  const double dof = calibration.covariance_dof;
  if (const Scatter scatter = ScatterOf(problem, calibration); scatter.dof > 0) {
    check.scatter_ratio = std::sqrt(scatter.mean_square);
    check.scatter_p_value = FisherTail(scatter.mean_square, scatter.dof, dof);
  }
  const auto [all_parts, columns] = PartsOf(problem, UnknownsOf(problem), options.is_target_in_place);
  const Solution start = options.is_target_in_place ? calibration : WithTargetsPlaced(problem, calibration, options);
  const std::optional<Evaluated> at = EvaluateAt(problem, start, options, columns);
  if (!at) return HiddenPoint();
  const Eigen::VectorXd squares = at->all_tested.colwise().squaredNorm();
  const Eigen::MatrixXd information = at->tested.transpose() * at->tested;
  const Eigen::VectorXd products = at->tested.transpose() * at->residuals;
  std::vector<TestedPart> parts;
  for (const TestedPart& part : all_parts) {
    std::optional<Eigen::MatrixXd> inverse = InverseInformation(part, information, squares);
    if (inverse) parts.emplace_back(part).inverse_information = *std::move(inverse);
  }
  const auto first_other =
      std::find_if(parts.begin(), parts.end(), [](const TestedPart& part) { return !IsMoved(part.change.part); });
  const std::vector<TestedPart> others(first_other, parts.end());
  parts.erase(first_other, parts.end());
  if (parts.empty()) return Failure{FailureCode("no_part_told")};

  const auto least_p_value = [&](const Eigen::VectorXd& of_images, double scale) {
    double least = 1;
    for (const TestedPart& part : parts) least = std::min(least, PValueOf(part, of_images, scale, dof));
    return least;
  };
  const Draws draws = DrawUnchanged(information, dof);
  std::vector<double> of_draws;
  for (Eigen::Index k = 0; k < kNumDraws; ++k)
    of_draws.push_back(least_p_value(draws.products.col(k), draws.scales[k]));
  std::sort(of_draws.begin(), of_draws.end());
  const double critical = of_draws[static_cast<size_t>(kFalseAlarms * kNumDraws)];
  const double least = least_p_value(products, 1);
  const auto num_below = std::upper_bound(of_draws.begin(), of_draws.end(), least) - of_draws.begin();
  // The draws do not reach far into the tail: there, Bonferroni's bound is close.
  constexpr int kFew = 20;
  check.p_value = num_below >= kFew ? static_cast<double>(num_below) / kNumDraws
                                    : std::min(1.0, static_cast<double>(parts.size()) * least);
  check.has_changed = least <= critical;
  if (extent == CheckExtent::kDecision) return check;
  for (const TestedPart& part : parts) {
    SessionChange& change = check.changes.emplace_back(part.change);
    change.covariance = part.inverse_information;
    change.change = part.inverse_information * products.segment(part.first, part.size);
    change.p_value = PValueOf(part, products, 1, dof);
    change.rank = -SquareOf(part, products);
    change.seen_m = SizeSeen(parts, part, false, information, draws, critical, dof);
    change.seen_rad = SizeSeen(parts, part, true, information, draws, critical, dof);
  }
  const bool is_doubtful = check.has_changed || check.scatter_p_value < kFalseAlarms;
  if (is_doubtful) {
    check = WithFittedChanges(std::move(check), problem, calibration, start, options, columns, *at, parts, others);
  } else {
    std::stable_sort(check.changes.begin(), check.changes.end(),
                     [](const SessionChange& a, const SessionChange& b) { return a.rank < b.rank; });
  }
  return check;
}

// Returns whether captures that hold would have seen a change that others show.
bool WouldSee(const SessionCheck& holding, const SessionChange& change) {
  if (!IsMoved(change.part)) return true;
  const auto same = std::find_if(holding.changes.begin(), holding.changes.end(), [&](const SessionChange& other) {
    return other.part == change.part && other.index == change.index;
  });
  if (same == holding.changes.end()) return false;
  return change.change.head<3>().norm() > same->seen_m || change.change.tail<3>().norm() > same->seen_rad;
}

// Returns the capture without which the others agree with the calibration best; nothing if they do not without any, or
// would not have seen what `all` shows.
std::optional<size_t> FindContradicting(const Problem& problem, const Solution& solution, const SessionOptions& options,
                                        const SessionCheck& all) {
  const auto without = [&](size_t capture) {
    Problem others = problem;
    others.captures[capture].images.clear();
    return others;
  };
  std::optional<size_t> found;
  double largest = 0;
  for (const size_t i : CapturesWithPoints(problem)) {
    const Outcome<SessionCheck> rest = CheckCaptures(without(i), solution, options, CheckExtent::kDecision);
    if (!rest || rest->has_changed) continue;
    // A lens is not tried here: an image that asks for another one scatters.
    const double agreement = IsMoved(all.changes.front().part) ? rest->p_value : 1 / rest->scatter_ratio;
    if (agreement <= largest) continue;
    found = i;
    largest = agreement;
  }
  if (!found) return std::nullopt;
  const Outcome<SessionCheck> rest = CheckCaptures(without(*found), solution, options, CheckExtent::kAll);
  if (!rest || rest->has_changed || IsMisfit(*rest) || !WouldSee(*rest, all.changes.front())) return std::nullopt;
  return found;
}

}  // namespace

Outcome<SessionCheck> CheckSession(const Problem& problem, const Solution& solution, const SessionOptions& options) {
  Outcome<SessionCheck> check = CheckCaptures(problem, solution, options, CheckExtent::kAll);
  constexpr size_t kFewestCaptures = 4;
  constexpr double kDecided = 1e-4;
  if (!check || !check->has_changed || check->p_value > kDecided) return check;
  if (CapturesWithPoints(problem).size() < kFewestCaptures) return check;
  check->contradicting = FindContradicting(problem, solution, options, *check);
  // A lens or a part that was exchanged changes all images, and not this one alone.
  const auto is_other = [](const SessionChange& change) { return !IsMoved(change.part); };
  const bool all_are_others = std::all_of(check->changes.begin(), check->changes.end(), is_other);
  if (check->contradicting && !all_are_others) std::erase_if(check->changes, is_other);
  return check;
}

}  // namespace heba
