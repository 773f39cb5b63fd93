#include "heba/session_check.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kFalseAlarms = 0.05;
constexpr double kSeen = 0.95;
constexpr int kNumDraws = 4000;
// A lens is found to have changed from this probability on, and if it moves the points by so many sigmas of a pixel
// (RMS): what the calibration's model of lens and target lacks is the same in many points, and smaller.
constexpr double kLensP = 1e-6;
constexpr double kLeastLensShift = 2;

// The residuals of all images at the calibration, whitened by everything that scatters them if nothing has changed, and
// their derivatives by the unknowns.
struct WhitenedSession {
  UnknownLayout layout;
  Eigen::MatrixXd by_unknowns;
  Eigen::VectorXd residuals;
};

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

// Adds the wobble of what grippers carry.
void AddWobble(const RigProblem& problem, const UnknownLayout& layout, const RobotNoise& wobble,
               Eigen::MatrixXd* covariance) {
  const Tangent6 variances = CorrectionVariances(wobble);
  const auto add = [&](const Mount& mount, const std::string& block) {
    const Eigen::Index first = layout.Block(block).first;
    if (mount.part == Mount::Part::kGripper) covariance->diagonal().segment<6>(first) += variances;
  };
  for (const RigCamera& camera : problem.cameras) add(camera.mount, CameraPoseBlock(camera));
  for (const RigTarget& target : problem.targets) add(target.mount, TargetPoseBlock(target));
}

// Adds the covariance of the rows of all views that the smooth errors of the arms cause. `first_rows` are the places of
// the views.
void AddSmoothErrors(const RigProblem& problem, const SessionOptions& options, const std::vector<LinearisedView>& views,
                     const std::vector<Eigen::Index>& first_rows, Eigen::MatrixXd* covariance) {
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
    Eigen::MatrixXd by_effects(covariance->rows(), sigmas.size());
    for (size_t v = 0; v < views.size(); ++v) {
      by_effects.middleRows(first_rows[v], views[v].offset.size()) =
          views[v].by_effects.middleCols<6>(6 * static_cast<Eigen::Index>(k)) * errors.GripperByEffects(poses[v]) *
          sigmas.asDiagonal();
    }
    *covariance += by_effects * by_effects.transpose();
  }
}

WhitenedSession Whiten(const RigProblem& problem, const RigSolution& solution, const SessionOptions& options,
                       const std::vector<LinearisedView>& views) {
  const Eigen::VectorXd variances =
      CorrectionVariances(NoiseOf(solution), NoisyJointsOf(problem, MovingRobots(problem)));
  WhitenedSession session{RigUnknowns(problem), {}, {}};
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
  AddSmoothErrors(problem, options, views, first_rows, &covariance);
  const Covariance& known =
      solution.covariance_repeatable.matrix.size() > 0 ? solution.covariance_repeatable : solution.covariance;
  Eigen::MatrixXd of_unknowns = CovarianceIn(session.layout, known);
  AddWobble(problem, session.layout, options.wobble, &of_unknowns);
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
    const Eigen::Vector3d direction(normal(random), normal(random), normal(random));
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

// Returns the parts that the images may tell, poses before lenses, with their columns in `by_unknowns`.
std::vector<TestedPart> PartsOf(const RigProblem& problem, const UnknownLayout& layout, bool has_targets,
                                std::vector<Eigen::Index>* columns) {
  std::vector<TestedPart> parts;
  const auto add = [&](ChangedPart kind, size_t index, const std::string& block_name) {
    const UnknownBlock block = layout.Block(block_name);
    if (block.size == 0) return;
    TestedPart& part = parts.emplace_back();
    part.change.part = kind;
    part.change.index = index;
    part.first = static_cast<Eigen::Index>(columns->size());
    part.size = block.size;
    for (Eigen::Index i = block.first; i < block.end(); ++i) columns->push_back(i);
  };
  for (size_t c = 0; c < problem.cameras.size(); ++c) add(ChangedPart::kCamera, c, CameraPoseBlock(problem.cameras[c]));
  for (size_t t = 0; t < problem.targets.size() && has_targets; ++t) {
    add(ChangedPart::kTarget, t, TargetPoseBlock(problem.targets[t]));
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) add(ChangedPart::kLens, c, CameraBlock(problem.cameras[c]));
  return parts;
}

// Sets the inverse information of a part. Returns false if the images do not determine its change. `squares` are those
// of the columns, with what another pose of moved targets explains.
bool SetInformation(const Eigen::MatrixXd& information, const Eigen::VectorXd& squares, TestedPart* part) {
  const Eigen::MatrixXd own = information.block(part->first, part->first, part->size, part->size);
  const Eigen::VectorXd scale = squares.segment(part->first, part->size).cwiseSqrt();
  if (!(scale.minCoeff() > 0)) return false;
  const Eigen::VectorXd inverse = scale.cwiseInverse();
  const Eigen::MatrixXd scaled = inverse.asDiagonal() * own * inverse.asDiagonal();
  constexpr double kNothing = 1e-9;
  if (!(EigenOfSymmetric(scaled).values.minCoeff() > kNothing)) return false;
  part->inverse_information = inverse.asDiagonal() * InverseOfSymmetric(scaled) * inverse.asDiagonal();
  return true;
}

// Returns whether the images show that a lens has changed; `products` are those of its columns with the residuals.
bool HasLensChanged(const RigProblem& problem, const std::vector<LinearisedView>& views, const UnknownLayout& layout,
                    const TestedPart& lens, const Eigen::VectorXd& products, double dof) {
  if (PValueOf(lens, products, 1, dof) >= kLensP) return false;
  const Eigen::VectorXd change = lens.inverse_information * products.segment(lens.first, lens.size);
  const UnknownBlock block = layout.Block(CameraBlock(problem.cameras[lens.change.index]));
  double squares = 0;
  for (const LinearisedView& view : views) {
    squares += (view.by_unknowns.middleCols(block.first, block.size) * change).squaredNorm();
  }
  int num_points = 0;
  for (const RigCapture& capture : problem.captures) {
    for (const RigImage& image : capture.images) {
      if (image.camera == lens.change.index) num_points += image.observations.size();
    }
  }
  return squares > kLeastLensShift * kLeastLensShift * 2 * num_points;
}

// Returns the ratio of the scatter of points about the best pose in each image to the noise, and its probability.
void SetScatter(const std::vector<LinearisedView>& views, double dof, SessionCheck* check) {
  double squares = 0;
  double number = 0;
  for (const LinearisedView& view : views) {
    squares += view.residual_sum_of_squares;
    number += view.num_residual_dof;
  }
  if (number <= 0) return;
  check->scatter_ratio = std::sqrt(squares / number);
  check->scatter_p_value = FisherTail(squares / number, number, dof);
}

}  // namespace

Outcome<SessionCheck> CheckSession(const RigProblem& problem_in, const RigSolution& solution,
                                   const SessionOptions& options) {
  const RigProblem problem = WeightedAs(solution, problem_in);
  SessionCheck check;
  for (const RigCapture& capture : problem.captures) check.num_images += static_cast<int>(capture.images.size());
  if (CapturesWithPoints(problem).empty()) return Failure{FailureCode("no_target")};
  const std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(problem, StateOf(solution), NoiseOf(solution), LossOf(LossKind::kNone));
  if (!views) return HiddenPoint();
  const double dof = solution.covariance_dof;
  SetScatter(*views, dof, &check);
  const WhitenedSession session = Whiten(problem, solution, options, *views);

  std::vector<Eigen::Index> columns;
  std::vector<TestedPart> parts = PartsOf(problem, session.layout, options.is_target_in_place, &columns);
  Eigen::MatrixXd tested = session.by_unknowns(Eigen::all, columns);
  const Eigen::VectorXd squares = tested.colwise().squaredNorm();
  Eigen::VectorXd residuals = session.residuals;
  if (!options.is_target_in_place) {
    std::vector<Eigen::Index> of_targets;
    for (const RigTarget& target : problem.targets) {
      const UnknownBlock block = session.layout.Block(TargetPoseBlock(target));
      for (Eigen::Index i = block.first; i < block.end(); ++i) of_targets.push_back(i);
    }
    const Eigen::MatrixXd moved = session.by_unknowns(Eigen::all, of_targets);
    const Eigen::MatrixXd products = moved.transpose() * moved;
    tested -= moved * SolveSymmetric(products, moved.transpose() * tested);
    residuals -= moved * SolveSymmetric(products, moved.transpose() * residuals);
  }
  const Eigen::MatrixXd information = tested.transpose() * tested;
  const Eigen::VectorXd products = tested.transpose() * residuals;
  std::erase_if(parts, [&](TestedPart& part) { return !SetInformation(information, squares, &part); });
  const auto first_lens = std::find_if(parts.begin(), parts.end(),
                                       [](const TestedPart& part) { return part.change.part == ChangedPart::kLens; });
  const std::vector<TestedPart> lenses(first_lens, parts.end());
  parts.erase(first_lens, parts.end());
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
  for (const TestedPart& part : parts) {
    SessionChange& change = check.changes.emplace_back(part.change);
    change.covariance = part.inverse_information;
    change.change = part.inverse_information * products.segment(part.first, part.size);
    change.p_value = PValueOf(part, products, 1, dof);
    change.seen_m = SizeSeen(parts, part, false, information, draws, critical, dof);
    change.seen_rad = SizeSeen(parts, part, true, information, draws, critical, dof);
  }
  for (const TestedPart& lens : lenses) {
    if (!HasLensChanged(problem, *views, session.layout, lens, products, dof)) continue;
    check.has_changed = true;
    SessionChange& change = check.changes.emplace_back(lens.change);
    change.covariance = lens.inverse_information;
    change.change = lens.inverse_information * products.segment(lens.first, lens.size);
    change.p_value = PValueOf(lens, products, 1, dof);
    check.p_value = std::min(check.p_value, change.p_value);
  }
  // By Akaike's criterion: probabilities of gross changes are all zero.
  const auto likelihood = [](const SessionChange& change) {
    return change.change.dot(SolveSymmetric(change.covariance, change.change)) -
           2 * static_cast<double>(change.change.size());
  };
  std::stable_sort(check.changes.begin(), check.changes.end(),
                   [&](const SessionChange& a, const SessionChange& b) { return likelihood(a) > likelihood(b); });
  return check;
}

}  // namespace heba
