#include "solvers/calibration/drift_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <string>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr size_t kFewestCaptures = 8;

// Returns the bodies of a single camera and a single target.
std::vector<DriftBody> BodiesOfPair() { return {{DriftBody::Kind::kCamera, 0}, {DriftBody::Kind::kTarget, 0}}; }
// Above this share, the order of the captures is a function of their poses.
constexpr double kOrderIsPose = 0.3;
// The repeatability of an industrial arm, and the largest distance at which its errors are the same but for that.
constexpr RobotNoise kRepeatability = {1e-4, DegToRad(0.02)};
constexpr double kSameErrorsM = 1e-3;
constexpr double kSameErrorsRad = DegToRad(0.2);
// One sigma of an error of a pose of which nothing is known.
constexpr RobotNoise kAnyError = {0.1, 0.2};

// A GroupProducts has the products of the whitened rows of captures that share an error of the robot. Its columns are
// the unknowns, then the poses of the bodies once more for each capture, and the offset.
struct GroupProducts {
  std::vector<size_t> captures;  // Indices in Problem::captures.
  Eigen::MatrixXd products;
  Eigen::Index num_rows = 0;
};

// The normal equations of drifts h, six numbers each, beside the unknowns x.
struct DriftEquations {
  Eigen::MatrixXd coupling;     // H_xh
  Eigen::MatrixXd information;  // H_hh
  Eigen::VectorXd gradient;     // g_h
};

struct LinearisedDrift {
  std::vector<GroupProducts> groups;
  Eigen::Index num_unknowns = 0;
  CaptureTimes times;
  std::vector<DriftBody> bodies;
};

// Returns the six rows of a capture of one image that another pose of the target would explain: a drift acts on no
// others.
LinearisedView PoseRows(const LinearisedView& view) {
  if (view.offset.size() < 6) return view;
  const Eigen::MatrixXd basis = HouseholderFactor(view.by_effects.leftCols<6>()).Basis();
  LinearisedView rows;
  rows.by_unknowns = basis.transpose() * view.by_unknowns;
  rows.by_effects = basis.transpose() * view.by_effects;
  rows.offset = basis.transpose() * view.offset;
  return rows;
}

// Returns the view of a group: its captures one above the other, with the columns of GroupProducts. `own_effects` adds
// the effects of each capture by itself after those that all share.
LinearisedView Stack(const std::vector<LinearisedView>& views, const std::vector<size_t>& members,
                     const std::vector<Eigen::Index>& bodies, bool own_effects) {
  Eigen::Index num_rows = 0;
  for (const size_t v : members) num_rows += views[v].offset.size();
  const Eigen::Index num_unknowns = views.front().by_unknowns.cols();
  const Eigen::Index num_effects = views.front().by_effects.cols();
  const auto num_members = static_cast<Eigen::Index>(members.size());
  const auto num_own = 6 * static_cast<Eigen::Index>(bodies.size());
  LinearisedView stack;
  stack.by_unknowns = Eigen::MatrixXd::Zero(num_rows, num_unknowns + num_own * num_members);
  stack.by_effects = Eigen::MatrixXd::Zero(num_rows, num_effects * (own_effects ? 1 + num_members : 1));
  stack.offset.resize(num_rows);
  Eigen::Index row = 0;
  for (Eigen::Index k = 0; k < num_members; ++k) {
    const LinearisedView& view = views[members[static_cast<size_t>(k)]];
    const Eigen::Index size = view.offset.size();
    stack.by_unknowns.block(row, 0, size, num_unknowns) = view.by_unknowns;
    for (size_t b = 0; b < bodies.size(); ++b) {
      stack.by_unknowns.block<Eigen::Dynamic, 6>(row, num_unknowns + num_own * k + 6 * static_cast<Eigen::Index>(b),
                                                 size, 6) = view.by_unknowns.middleCols<6>(bodies[b]);
    }
    stack.by_effects.block(row, 0, size, num_effects) = view.by_effects;
    if (own_effects) stack.by_effects.block(row, num_effects * (1 + k), size, num_effects) = view.by_effects;
    stack.offset.segment(row, size) = view.offset;
    row += size;
  }
  return stack;
}

// Returns the groups of captures at nearly one pose.
CaptureGroups Revisits(const Problem& problem) {
  CaptureGroups groups;
  for (const size_t i : CapturesWithPoints(problem)) {
    const Rigid3d& pose = problem.captures[i].base_from_gripper.front();
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const std::vector<size_t>& group) {
      const Rigid3d& first = problem.captures[group.front()].base_from_gripper.front();
      return DistanceM(first, pose) < kSameErrorsM && AngleRad(first, pose) < kSameErrorsRad;
    });
    if (same == groups.end()) {
      groups.push_back({i});
    } else {
      same->push_back(i);
    }
  }
  return groups;
}

// Returns the unknown pose of a body.
UnknownBlock PoseOf(const Problem& problem, const UnknownLayout& layout, const DriftBody& body) {
  switch (body.kind) {
    case DriftBody::Kind::kCamera:
      return layout.Block(CameraPoseBlock(problem.cameras[body.index]));
    case DriftBody::Kind::kTarget:
      return layout.Block(TargetPoseBlock(problem.targets[body.index]));
    case DriftBody::Kind::kBase:
      break;
  }
  return layout.Block(BaseBlock(problem.robots[body.index]));
}

// Linearises the captures; `at_revisits`: only what those at one pose say against each other. Returns nothing if a
// point cannot be projected, or if the pose of a body is not unknown.
std::optional<LinearisedDrift> LineariseDrift(const Problem& problem, const Solution& solution,
                                              const std::vector<DriftBody>& bodies, const CaptureTimes& times,
                                              bool at_revisits) {
  const Problem weighted = WeightedAs(solution, problem);
  const FitNoise noise = NoiseOf(solution);
  const std::vector<size_t> captures = CapturesWithPoints(weighted);
  FitState state = StateOf(solution);
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(weighted, state, noise, LossOf(LossKind::kNone));
  // Captures that are far from the solution are linearised at the poses that they show.
  constexpr int kNumSteps = 2;
  for (int step = 0; at_revisits && step < kNumSteps && views && views->size() == captures.size(); ++step) {
    state.corrections.assign(weighted.captures.size(), std::vector<Rigid3d>(weighted.robots.size()));
    for (size_t v = 0; v < views->size(); ++v) {
      const LinearisedView& view = (*views)[v];
      if (view.offset.size() < 6) continue;
      const Eigen::MatrixXd by_pose = view.by_effects.leftCols<6>();
      const Tangent6 correction = SolveSymmetric(Eigen::MatrixXd(by_pose.transpose() * by_pose),
                                                 Eigen::VectorXd(by_pose.transpose() * view.offset));
      state.corrections[captures[v]].front() = Retract(Rigid3d(), correction);
    }
    views = LineariseEachCapture(weighted, state, noise, LossOf(LossKind::kNone));
  }
  if (!views || views->empty()) return std::nullopt;
  std::vector<bool> is_misread;
  for (LinearisedView& view : *views) {
    // The pixels of a target that is read rightly fit some pose.
    constexpr double kMostSquare = 9;
    is_misread.push_back(view.residual_sum_of_squares > kMostSquare * std::max(1, view.num_residual_dof));
    if (weighted.cameras.size() == 1 && weighted.targets.size() == 1) view = PoseRows(view);
  }
  const UnknownLayout layout = UnknownsOf(weighted);
  std::vector<Eigen::Index> first_of_bodies;
  for (const DriftBody& body : bodies) {
    const UnknownBlock pose = PoseOf(weighted, layout, body);
    if (pose.size != 6) return std::nullopt;
    first_of_bodies.push_back(pose.first);
  }
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(weighted, MovingRobots(weighted));
  const Eigen::VectorXd variances = CorrectionVariances(noise, num_joints);
  LinearisedDrift linearised{{}, layout.size(), times, bodies};
  for (const std::vector<size_t>& group : at_revisits ? Revisits(weighted) : GroupByRobotPoses(weighted)) {
    if (at_revisits && group.size() < 2) continue;
    std::vector<size_t> members;
    std::vector<size_t> of_group;
    for (const size_t i : group) {
      const auto member = static_cast<size_t>(std::find(captures.begin(), captures.end(), i) - captures.begin());
      if (at_revisits && is_misread[member]) continue;
      members.push_back(member);
      of_group.push_back(i);
    }
    if (members.size() < (at_revisits ? 2U : 1U)) continue;
    LinearisedView stack = Stack(*views, members, first_of_bodies, at_revisits);
    Eigen::VectorXd of_effects = variances;
    if (at_revisits) {
      RobotNoise repeated = kRepeatability;
      if (!noise.robots.empty()) {
        repeated.translation_m = std::min(repeated.translation_m, noise.robots.front().translation_m);
        repeated.rotation_rad = std::min(repeated.rotation_rad, noise.robots.front().rotation_rad);
      }
      const Eigen::Index num_effects = views->front().by_effects.cols();
      of_effects = Eigen::VectorXd::Zero(stack.by_effects.cols());
      for (Eigen::Index k = 0; num_effects >= 6 && k <= static_cast<Eigen::Index>(members.size()); ++k) {
        of_effects.segment<6>(num_effects * k) = CorrectionVariances(k == 0 ? kAnyError : repeated);
      }
    }
    if (stack.by_effects.cols() != of_effects.size()) of_effects = Eigen::VectorXd::Zero(stack.by_effects.cols());
    const RowMajorMatrix rows = WhitenedRows(stack, 1, of_effects);
    linearised.groups.push_back({of_group, rows.transpose() * rows, rows.rows()});
  }
  return linearised;
}

// Returns the equations of drifts. At the optimum of the unknowns, their gradient is zero.
DriftEquations EquationsOf(const LinearisedDrift& linearised, const std::vector<Drift>& drifts) {
  const Eigen::Index p = linearised.num_unknowns;
  const auto size = 6 * static_cast<Eigen::Index>(drifts.size());
  const auto num_of_bodies = 6 * static_cast<Eigen::Index>(linearised.bodies.size());
  DriftEquations equations{Eigen::MatrixXd::Zero(p, size), Eigen::MatrixXd::Zero(size, size),
                           Eigen::VectorXd::Zero(size)};
  for (const GroupProducts& group : linearised.groups) {
    const Eigen::Index last = group.products.cols() - 1;
    // The columns of the drifts are combinations of those of the bodies' poses in the captures of the group.
    Eigen::MatrixXd by_drifts = Eigen::MatrixXd::Zero(last - p, size);
    for (size_t k = 0; k < group.captures.size(); ++k) {
      for (size_t d = 0; d < drifts.size(); ++d) {
        const auto body = std::find(linearised.bodies.begin(), linearised.bodies.end(), drifts[d].body);
        const auto first = 6 * static_cast<Eigen::Index>(body - linearised.bodies.begin());
        const double share =
            RemainingShare(drifts[d], linearised.times.places[group.captures[k]], linearised.times.num_captures);
        by_drifts.block<6, 6>(num_of_bodies * static_cast<Eigen::Index>(k) + first, 6 * static_cast<Eigen::Index>(d)) =
            -share * Eigen::Matrix<double, 6, 6>::Identity();
      }
    }
    const Eigen::Index num_own = last - p;
    equations.coupling += group.products.block(0, p, p, num_own) * by_drifts;
    equations.information += by_drifts.transpose() * group.products.block(p, p, num_own, num_own) * by_drifts;
    equations.gradient += by_drifts.transpose() * group.products.block(p, last, num_own, 1);
  }
  return equations;
}

struct DriftSolution {
  Eigen::VectorXd changes;
  Eigen::MatrixXd covariance;
  double statistic = 0;
};

// Solves the equations; nothing if the captures do not determine the drifts. The unknowns are held at revisits, which
// say nothing about them.
std::optional<DriftSolution> Solve(const DriftEquations& equations, const Eigen::MatrixXd& covariance, bool are_held) {
  Eigen::MatrixXd reduced = equations.information;
  if (!are_held) reduced -= equations.coupling.transpose() * covariance * equations.coupling;
  // A direction that the other unknowns take up leaves the rounding of the difference.
  constexpr double kRank = 1e-9;
  if (!(equations.information.diagonal().minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd scales = equations.information.diagonal().cwiseSqrt().cwiseInverse();
  const auto factor = Cholesky(Eigen::MatrixXd(scales.asDiagonal() * reduced * scales.asDiagonal()));
  if (!factor || Eigen::VectorXd(factor->lower().diagonal()).minCoeff() < std::sqrt(kRank)) return std::nullopt;
  DriftSolution solution;
  solution.covariance = scales.asDiagonal() * factor->Inverse() * scales.asDiagonal();
  solution.changes = solution.covariance * equations.gradient;
  solution.statistic = solution.changes.dot(equations.gradient);
  return solution;
}

// Returns the drift that has this place in a solution, as it was estimated.
Drift Estimated(Drift drift, const DriftSolution& solution, size_t index) {
  const auto first = 6 * static_cast<Eigen::Index>(index);
  drift.change = solution.changes.segment<6>(first);
  drift.covariance = solution.covariance.block<6, 6>(first, first);
  return drift;
}

// The squares of all whitened residuals, and the number of their degrees of freedom beside the unknowns; nothing if the
// noise is known.
struct SquaresOfResiduals {
  double squares = 0;
  double dof = 0;
};

SquaresOfResiduals ResidualsOf(const Problem& problem, const Solution& solution, const LinearisedDrift& linearised) {
  SquaresOfResiduals residuals;
  for (const GroupProducts& group : linearised.groups) {
    residuals.squares += group.products(group.products.cols() - 1, group.products.cols() - 1);
    residuals.dof += static_cast<double>(group.num_rows);
  }
  residuals.dof -= static_cast<double>(linearised.num_unknowns);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    // An effect takes as much of a degree of freedom as the captures reduce its variance.
    const Eigen::Index first = solution.covariance.layout.Block(ErrorsBlock(problem.robots[r])).first;
    for (Eigen::Index i = 0; i < effects->size(); ++i) {
      const double sigma = solution.effect_sigmas[r][effects->effects[static_cast<size_t>(i)].group];
      const double variance = solution.covariance.matrix(first + i, first + i);
      residuals.dof += sigma > 0 ? variance / (sigma * sigma) : 1;
    }
  }
  return residuals;
}

// Returns the squares that a drift of this statistic leaves.
double RestOf(double statistic, const SquaresOfResiduals& residuals) {
  return std::max(1e-9 * residuals.squares, residuals.squares - std::max(0.0, statistic));
}

// Returns the probability of a statistic by chance. The noise was estimated from the residuals, which the drift is part
// of.
double TailOf(double statistic, const std::optional<SquaresOfResiduals>& residuals) {
  const double clamped = std::max(0.0, statistic);
  if (!residuals) return ChiSquareTail(clamped, 6);
  const double dof = residuals->dof - 6;
  if (!(dof >= 1)) return 1;
  return FisherTail(clamped / 6 / (RestOf(statistic, *residuals) / dof), 6, dof);
}

// Returns how many times as likely a drift is as another one.
double OddsOf(double statistic, double other, const std::optional<SquaresOfResiduals>& residuals) {
  constexpr double kMostLog = 100;
  const double log_odds =
      residuals ? 0.5 * residuals->dof * std::log(RestOf(other, *residuals) / RestOf(statistic, *residuals))
                : 0.5 * (statistic - other);
  return std::exp(std::min(kMostLog, log_odds));
}

// Long sessions are tested for steps at so many places, and then at those beside the clearest.
constexpr size_t kMostSteps = 60;

// Returns the steps of a body before every `stride`-th capture from `first` on, up to `last`.
std::vector<Drift> StepsOf(const DriftBody& body, size_t first, size_t last, size_t stride) {
  std::vector<Drift> steps;
  for (size_t k = first; k <= last; k += stride) {
    Drift& step = steps.emplace_back();
    step.body = body;
    step.form = DriftForm::kStep;
    step.capture = k;
  }
  return steps;
}

// Returns the clearest drift, with its p-value; nothing if none is determined. Without residuals the noise is known,
// and the unknowns are held.
std::optional<Drift> Clearest(const LinearisedDrift& linearised, const Solution& solution,
                              const std::optional<SquaresOfResiduals>& residuals) {
  const bool are_held = !residuals;
  // The largest of the statistics of all steps is distributed like that of so many independent ones at the most.
  constexpr double kIndependentSteps = 20;
  const size_t num_captures = linearised.times.num_captures;
  const double num_steps = std::min(kIndependentSteps, static_cast<double>(num_captures));
  std::optional<Drift> clearest;
  double statistic_of_clearest = 0;
  std::vector<std::pair<Drift, double>> tested;
  const auto test = [&](const std::vector<Drift>& candidates) {
    for (Drift drift : candidates) {
      const std::optional<DriftSolution> solved =
          Solve(EquationsOf(linearised, {drift}), solution.covariance.matrix, are_held);
      if (!solved) continue;
      drift = Estimated(std::move(drift), *solved, 0);
      const double num_tests =
          (drift.form == DriftForm::kStep ? num_steps : 1) * 2 * static_cast<double>(linearised.bodies.size());
      drift.p_value = std::min(1.0, num_tests * TailOf(solved->statistic, residuals));
      tested.emplace_back(drift, solved->statistic);
      const bool is_clearer = !clearest || drift.p_value < clearest->p_value ||
                              (drift.p_value == clearest->p_value && solved->statistic > statistic_of_clearest);
      if (!is_clearer) continue;
      clearest = drift;
      statistic_of_clearest = solved->statistic;
    }
  };
  // The first and the last step leave two captures on either side.
  constexpr size_t kFewestAtEnd = 2;
  const size_t stride = 1 + num_captures / kMostSteps;
  for (const DriftBody& body : linearised.bodies) {
    Drift linear;
    linear.body = body;
    test({linear});
    if (num_captures >= 2 * kFewestAtEnd) test(StepsOf(body, kFewestAtEnd, num_captures - kFewestAtEnd, stride));
  }
  if (stride > 1 && clearest && clearest->form == DriftForm::kStep) {
    const size_t first = std::max(kFewestAtEnd, clearest->capture - std::min(clearest->capture, stride));
    const size_t last = std::min(num_captures - kFewestAtEnd, clearest->capture + stride);
    for (const DriftBody& body : linearised.bodies) test(StepsOf(body, first, last, 1));
  }
  std::optional<double> best_of_other_body;
  for (const auto& [drift, statistic] : tested) {
    if (drift.body != clearest->body && (!best_of_other_body || statistic > *best_of_other_body)) {
      best_of_other_body = statistic;
    }
  }
  if (best_of_other_body) {
    clearest->odds_of_side = OddsOf(statistic_of_clearest, *best_of_other_body, residuals);
  }
  return clearest;
}

// Returns whether the drift was found, and is estimated, by captures at one pose; it is then the only one.
bool AreAtRevisits(const std::vector<Drift>& drifts) {
  return drifts.size() == 1 && drifts.front().evidence == DriftEvidence::kRevisits;
}

// Returns the solution as that of all captures that were detected, none of which is corrected.
Solution AtDetected(Solution solution, const Problem& detected) {
  const bool is_exact = NoiseOf(solution).robots.empty();
  solution.captures.assign(detected.captures.size(), {});
  for (CaptureOutcome& outcome : solution.captures) outcome.corrections.resize(is_exact ? 0 : detected.robots.size());
  solution.effects.clear();
  solution.effect_sigmas.clear();
  return solution;
}

// Returns the drift that captures at one pose show. They tell that there is one and how large it is; of its body, its
// form and its place, those that the others show are taken if they explain the captures at one pose, too.
std::optional<Drift> FindAtRevisits(const LinearisedDrift& revisits, const Solution& solution,
                                    const std::optional<Drift>& in_order) {
  std::optional<Drift> found = Clearest(revisits, solution, std::nullopt);
  if (!found || found->p_value >= kDriftByChance) return std::nullopt;
  double squares = 0;
  Eigen::Index num_rows = 0;
  for (const GroupProducts& group : revisits.groups) {
    squares += group.products(group.products.cols() - 1, group.products.cols() - 1);
    num_rows += group.num_rows - 6;  // The pose of the group is free.
  }
  // The probability of what a drift leaves of the differences.
  const auto rest_by_chance = [&](const DriftSolution& solved) {
    return ChiSquareTail(std::max(0.0, squares - solved.statistic), static_cast<double>(num_rows - 6));
  };
  constexpr double kNoise = 1e-4;
  const std::optional<DriftSolution> own = Solve(EquationsOf(revisits, {*found}), {}, true);
  if (num_rows <= 6 || !own || rest_by_chance(*own) < kNoise) return std::nullopt;
  found->evidence = DriftEvidence::kRevisits;
  found->odds_of_side = 1;
  if (!in_order) return found;
  const std::optional<DriftSolution> as_others = Solve(EquationsOf(revisits, {*in_order}), {}, true);
  if (!as_others || rest_by_chance(*as_others) < kNoise) return found;
  const double p_value = found->p_value;
  found = Estimated(*in_order, *as_others, 0);
  found->p_value = p_value;
  found->evidence = DriftEvidence::kRevisits;
  return found;
}

std::vector<DriftBody> BodiesOf(const std::vector<Drift>& drifts) {
  std::vector<DriftBody> bodies;
  for (const Drift& drift : drifts) {
    if (std::find(bodies.begin(), bodies.end(), drift.body) == bodies.end()) bodies.push_back(drift.body);
  }
  return bodies;
}

// Returns what excludes that the errors of the robot look like a drift to a test in the order of the captures.
std::optional<DriftEvidence> EvidenceOf(const Problem& problem, const Solution& solution, double order_by_pose) {
  // Without noise of the robot, its errors are in the residuals of the pixels, which they make unequal.
  if (NoiseOf(solution).robots.empty()) return std::nullopt;
  const SharedEffects* const effects = EffectsOf(problem, 0);
  if (effects != nullptr && effects->kind == SharedEffectsKind::kArm) return DriftEvidence::kArm;
  if (order_by_pose < kOrderIsPose) return DriftEvidence::kOrder;
  return std::nullopt;
}

DriftSide SideOf(const Problem& problem, const DriftBody& body) {
  const bool is_carried =
      (body.kind == DriftBody::Kind::kCamera && problem.cameras[body.index].mount.part == Mount::Part::kGripper) ||
      (body.kind == DriftBody::Kind::kTarget && problem.targets[body.index].mount.part == Mount::Part::kGripper);
  return is_carried ? DriftSide::kHand : DriftSide::kWorld;
}

// Returns the name of a body, after the key that it has in findings.
std::pair<std::string, std::string> NameOfBody(const Problem& problem, const DriftBody& body) {
  switch (body.kind) {
    case DriftBody::Kind::kCamera:
      return {"of_camera", problem.cameras[body.index].name};
    case DriftBody::Kind::kTarget:
      return {"of_target", problem.targets[body.index].name};
    case DriftBody::Kind::kBase:
      break;
  }
  return {"of_arm", problem.robots[body.index]};
}

}  // namespace

double OrderByPose(const std::vector<Rigid3d>& all_poses, const std::vector<size_t>& all_places) {
  // An evenly spaced sample of a long session tells as much.
  constexpr size_t kMostPoses = 300;
  std::vector<Rigid3d> poses;
  std::vector<size_t> places;
  for (size_t i = 0; i < all_poses.size(); i += 1 + all_poses.size() / kMostPoses) {
    poses.push_back(all_poses[i]);
    places.push_back(all_places[i]);
  }
  const size_t n = poses.size();
  if (n < 3) return 0;
  double mean_place = 0;
  for (const size_t place : places) mean_place += static_cast<double>(place) / static_cast<double>(n);
  double total = 0;
  for (const size_t place : places) total += std::pow(static_cast<double>(place) - mean_place, 2);
  double spread_m2 = 0;
  double spread_rad2 = 0;
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < i; ++j) {
      spread_m2 += std::pow(DistanceM(poses[i], poses[j]), 2);
      spread_rad2 += std::pow(AngleRad(poses[i], poses[j]), 2);
    }
  }
  const double num_pairs = 0.5 * static_cast<double>(n * (n - 1));
  spread_m2 = std::max(spread_m2 / num_pairs, 1e-12);
  spread_rad2 = std::max(spread_rad2 / num_pairs, 1e-12);
  double best = 0;
  for (const double width : {0.05, 0.1, 0.2, 0.3, 0.5, 0.8}) {
    double errors = 0;
    for (size_t i = 0; i < n; ++i) {
      double sum = 0;
      double weights = 0;
      for (size_t j = 0; j < n; ++j) {
        if (j == i) continue;
        const double square = std::pow(DistanceM(poses[i], poses[j]), 2) / spread_m2 +
                              std::pow(AngleRad(poses[i], poses[j]), 2) / spread_rad2;
        const double weight = std::exp(-0.5 * square / (width * width));
        sum += weight * static_cast<double>(places[j]);
        weights += weight;
      }
      constexpr double kNone = 1e-300;
      const double predicted = weights > kNone ? sum / weights : mean_place;
      errors += std::pow(static_cast<double>(places[i]) - predicted, 2);
    }
    best = std::max(best, 1 - errors / total);
  }
  return best;
}

CaptureTimes TimesInOrder(size_t num_captures) {
  CaptureTimes times{std::vector<size_t>(num_captures), num_captures};
  std::iota(times.places.begin(), times.places.end(), size_t{0});
  return times;
}

DriftSearch FindDrift(const Problem& problem, const Solution& solution, const CaptureTimes& times,
                      const DetectedCaptures& detected) {
  DriftSearch search;
  const bool is_single =
      problem.cameras.size() == 1 && problem.targets.size() == 1 && MovingRobots(problem).size() == 1;
  if (!is_single || CapturesWithPoints(problem).size() < kFewestCaptures) return search;
  // Poses that are taken again say nothing about the order of the others.
  std::vector<Rigid3d> poses;
  std::vector<size_t> places;
  for (const std::vector<size_t>& group : Revisits(problem)) {
    poses.push_back(problem.captures[group.front()].base_from_gripper.front());
    places.push_back(times.places[group.front()]);
  }
  const double order_by_pose = OrderByPose(poses, places);
  const std::optional<DriftEvidence> evidence = EvidenceOf(problem, solution, order_by_pose);
  const std::optional<LinearisedDrift> all = LineariseDrift(problem, solution, BodiesOfPair(), times, false);
  if (!all) return search;
  std::optional<Drift> in_order = Clearest(*all, solution, ResidualsOf(problem, solution, *all));
  const double by_chance = evidence == DriftEvidence::kArm ? kDriftByChanceBesideArm : kDriftByChanceInOrder;
  if (evidence && in_order && in_order->p_value < by_chance) {
    in_order->evidence = *evidence;
    search.found = in_order;
    return search;
  }
  const std::optional<LinearisedDrift> revisits =
      LineariseDrift(detected.problem, AtDetected(solution, detected.problem), BodiesOfPair(), detected.times, true);
  constexpr size_t kFewestRevisits = 2;
  const bool has_revisits = revisits && revisits->groups.size() >= kFewestRevisits;
  if (has_revisits) search.found = FindAtRevisits(*revisits, solution, in_order);
  const bool is_exact = NoiseOf(solution).robots.empty() && EffectsOf(problem, 0) == nullptr;
  if (!search.found && !evidence && !has_revisits && !is_exact) {
    search.unseen = Finding{Grade::kGood, FindingCode("drift_unseen"), {{"order_by_pose", order_by_pose}}};
  }
  return search;
}

std::optional<Drift> FindCreepOfCamera(const Problem& problem, const Solution& solution, const CaptureTimes& times) {
  // The residuals of the pixels have the errors of the arms if these have no noise.
  if (NoiseOf(solution).robots.empty()) return std::nullopt;
  std::vector<size_t> num_shared(problem.cameras.size(), 0);
  for (const ProblemCapture& capture : problem.captures) {
    std::set<size_t> seen_by;
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() > 0) seen_by.insert(image.camera);
    }
    for (const size_t c : seen_by) num_shared[c] += seen_by.size() > 1 ? 1 : 0;
  }
  std::vector<DriftBody> cameras;
  for (size_t c = 0; c < num_shared.size(); ++c) {
    if (num_shared[c] >= kFewestCaptures) cameras.push_back({DriftBody::Kind::kCamera, c});
  }
  if (cameras.empty()) return std::nullopt;
  const std::optional<LinearisedDrift> all = LineariseDrift(problem, solution, cameras, times, false);
  if (!all) return std::nullopt;
  const SquaresOfResiduals residuals = ResidualsOf(problem, solution, *all);
  std::optional<Drift> clearest;
  for (const DriftBody& camera : cameras) {
    Drift drift;
    drift.body = camera;
    drift.evidence = DriftEvidence::kCameras;
    const std::optional<DriftSolution> solved = Solve(EquationsOf(*all, {drift}), solution.covariance.matrix, false);
    if (!solved) continue;
    drift = Estimated(std::move(drift), *solved, 0);
    drift.p_value = std::min(1.0, static_cast<double>(cameras.size()) * TailOf(solved->statistic, residuals));
    if (!clearest || drift.p_value < clearest->p_value) clearest = drift;
  }
  if (!clearest || clearest->p_value >= kDriftByChanceBesideArm) return std::nullopt;
  return clearest;
}

std::optional<std::vector<Drift>> EstimateDrifts(const Problem& problem, const Solution& solution,
                                                 const CaptureTimes& times, std::vector<Drift> drifts) {
  const std::optional<LinearisedDrift> linearised = LineariseDrift(problem, solution, BodiesOf(drifts), times, false);
  if (!linearised || linearised->groups.empty()) return std::nullopt;
  const std::optional<DriftSolution> solved =
      Solve(EquationsOf(*linearised, drifts), solution.covariance.matrix, false);
  if (!solved) return std::nullopt;
  for (size_t d = 0; d < drifts.size(); ++d) drifts[d] = Estimated(std::move(drifts[d]), *solved, d);
  return drifts;
}

std::vector<Eigen::VectorXd> ChangesByDrifts(const Problem& problem, const Solution& solution,
                                             const CaptureTimes& times, const std::vector<Drift>& drifts) {
  if (drifts.empty()) return {};
  const std::optional<LinearisedDrift> all = LineariseDrift(problem, solution, BodiesOf(drifts), times, false);
  if (!all) return {};
  const DriftEquations equations = EquationsOf(*all, drifts);
  Eigen::MatrixXd covariance = drifts.front().covariance;
  if (!AreAtRevisits(drifts)) {
    const std::optional<DriftSolution> solved = Solve(equations, solution.covariance.matrix, false);
    if (!solved) return {};
    covariance = solved->covariance;
  }
  const auto root = Cholesky(covariance);
  if (!root) return {};
  const Eigen::MatrixXd columns =
      solution.covariance.matrix * equations.coupling * root->lower().triangularView<Eigen::Lower>();
  std::vector<Eigen::VectorXd> changes;
  for (Eigen::Index j = 0; j < columns.cols(); ++j) changes.emplace_back(columns.col(j));
  return changes;
}

Finding DescribeDrift(const Problem& problem, const Drift& drift, const std::string& capture, bool is_corrected) {
  const auto root_of_sum = [&](Eigen::Index first) {
    return std::sqrt(drift.covariance.diagonal().segment<3>(first).sum());
  };
  // A drift that was estimated without a test may be none.
  const bool is_wanted = drift.evidence == DriftEvidence::kWanted || drift.evidence == DriftEvidence::kMotion;
  const double p_value =
      is_wanted ? ChiSquareTail(MahalanobisSquare(drift.change, drift.covariance), 6) : drift.p_value;
  Finding finding{p_value < kDriftByChance ? Grade::kDoubtful : Grade::kGood, FindingCode("drift")};
  finding.numbers = {{"change_mm", 1000 * drift.change.head<3>().norm()},
                     {"change_deg", RadToDeg(drift.change.tail<3>().norm())},
                     {"sigma_mm", 1000 * root_of_sum(0)},
                     {"sigma_deg", RadToDeg(root_of_sum(3))},
                     {"p", p_value},
                     {"odds_of_side", drift.odds_of_side}};
  for (Eigen::Index i = 0; i < 6; ++i) {
    constexpr const char* kNames[] = {"x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"};
    finding.numbers.emplace_back(kNames[i], i < 3 ? 1000 * drift.change[i] : RadToDeg(drift.change[i]));
  }
  finding.names = {{"body", std::string(kDriftBodyNames[static_cast<size_t>(drift.body.kind)])},
                   {"side", std::string(kDriftSideNames[static_cast<size_t>(SideOf(problem, drift.body))])},
                   {"form", std::string(kDriftFormNames[static_cast<size_t>(drift.form)])},
                   {"evidence", std::string(kDriftEvidenceNames[static_cast<size_t>(drift.evidence)])}};
  const auto [key, name] = NameOfBody(problem, drift.body);
  if (!name.empty()) finding.names.emplace_back(key, name);
  finding.names.emplace_back("use", is_corrected ? "corrected" : "not_corrected");
  if (drift.form == DriftForm::kStep) finding.names.emplace_back("capture", capture);
  finding.is_cause = finding.grade != Grade::kGood;
  return finding;
}

}  // namespace heba
