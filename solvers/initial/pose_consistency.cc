#include "solvers/initial/pose_consistency.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Dense>

#include "heba/base/even_indices.h"
#include "heba/base/rng.h"

namespace heba {
namespace {

constexpr double kQuantile = 0.7;
constexpr int kNumTriples = 150;
constexpr int kNumRounds = 4;
// Captures whose misfit is within this factor of the quantile are used to re-estimate the solution.
constexpr double kFits = 2.0;

// Returns the 70 % quantile.
double QuantileOf(std::vector<double> values) {
  const auto at = values.begin() + std::lround(kQuantile * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// One capture with one of its candidates.
struct Choice {
  size_t capture = 0;
  size_t candidate = 0;
};

// The rotations of X and Z.
struct Rotations {
  Eigen::Quaterniond x = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond z = Eigen::Quaterniond::Identity();
};

// t_Z and t_X, m, and the scale k of the robot's translations.
using Translations = Eigen::Matrix<double, 7, 1>;

// Linear equations in Translations.
struct TranslationEquations {
  Eigen::MatrixXd left;
  Eigen::VectorXd right;
};

// The misfits of all captures with a solution, and the best candidate of each.
struct RotationFit {
  std::vector<double> misfit;
  std::vector<size_t> candidate;
  double typical = std::numeric_limits<double>::infinity();
};

class Solver {
 public:
  explicit Solver(const std::vector<PoseCandidates>& captures) : captures_(captures) {}

  // Estimates R_X from the rotation vectors of the motions, a = R_X b, by Kabsch's method, and R_Z as the mean over
  // the captures.
  Rotations SolveRotations(const std::vector<Choice>& all) const {
    // The number of pairs grows quadratically, so at most kMost captures are used, evenly spread.
    constexpr size_t kMost = 100;
    std::vector<Choice> chosen;
    for (const size_t i : EvenIndices(all.size(), kMost)) chosen.push_back(all[i]);
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < chosen.size(); ++i) {
      for (size_t j = i + 1; j < chosen.size(); ++j) {
        const Eigen::Vector3d a = LogRotation(Mount(chosen[j]).rotation * Mount(chosen[i]).rotation.conjugate());
        const Eigen::Vector3d b = LogRotation(Seen(chosen[j]).rotation * Seen(chosen[i]).rotation.conjugate());
        cross += a * b.transpose();
      }
    }
    Rotations solved;
    solved.x = Eigen::Quaterniond(NearestRotation(cross)).normalized();
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const Choice& choice : chosen) {
      sum += (Mount(choice).rotation.conjugate() * solved.x * Seen(choice).rotation).toRotationMatrix();
    }
    solved.z = Eigen::Quaterniond(NearestRotation(sum)).normalized();
    return solved;
  }

  // Computes the rotation misfits, rad, of all captures.
  RotationFit JudgeRotations(const Rotations& rotations) const {
    RotationFit fit;
    for (size_t i = 0; i < captures_.size(); ++i) {
      const Eigen::Quaterniond by_robot = captures_[i].camera_mount_from_target_mount.rotation * rotations.z;
      double best = std::numeric_limits<double>::infinity();
      size_t candidate = 0;
      for (size_t k = 0; k < captures_[i].camera_from_target.size(); ++k) {
        const double angle = by_robot.angularDistance(rotations.x * captures_[i].camera_from_target[k].rotation);
        if (angle < best) {
          best = angle;
          candidate = k;
        }
      }
      fit.misfit.push_back(best);
      fit.candidate.push_back(candidate);
    }
    fit.typical = QuantileOf(fit.misfit);
    return fit;
  }

  // Solves EquationsOf by least squares. The scale is 1 unless it is free.
  Translations SolveTranslations(const Rotations& rotations, const std::vector<Choice>& chosen,
                                 RobotScale scale) const {
    const TranslationEquations equations = EquationsOf(rotations, chosen, scale);
    Translations solved = Translations::Ones();
    solved.head(equations.left.cols()) =
        Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(equations.left).solve(equations.right);
    return solved;
  }

  // Returns the sigma of the scale, estimated from `chosen`.
  double ScaleStddev(const Rotations& rotations, const Translations& solved, const std::vector<Choice>& chosen) const {
    const TranslationEquations equations = EquationsOf(rotations, chosen, RobotScale::kFree);
    // The component of the last column that is orthogonal to the others.
    const Eigen::MatrixXd others = equations.left.leftCols(6);
    const Eigen::VectorXd last = equations.left.col(6);
    const Eigen::VectorXd rest =
        last - others * Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(others).solve(last);
    const double variance =
        (equations.left * solved - equations.right).squaredNorm() /
        static_cast<double>(std::max<Eigen::Index>(1, equations.left.rows() - equations.left.cols()));
    return rest.norm() > 0 ? std::sqrt(variance) / rest.norm() : std::numeric_limits<double>::infinity();
  }

  // Computes the translation misfits, m, of `choices`.
  std::vector<double> JudgeTranslations(const Rotations& rotations, const Translations& solved,
                                        const std::vector<Choice>& choices) const {
    std::vector<double> misfits;
    for (const Choice& choice : choices) {
      const Rigid3d& mount = Mount(choice);
      misfits.push_back((mount.rotation * Eigen::Vector3d(solved.head<3>()) + solved[6] * mount.translation -
                         rotations.x * Seen(choice).translation - solved.segment<3>(3))
                            .norm());
    }
    return misfits;
  }

  const Rigid3d& Mount(const Choice& choice) const { return captures_[choice.capture].camera_mount_from_target_mount; }
  const Rigid3d& Seen(const Choice& choice) const {
    return captures_[choice.capture].camera_from_target[choice.candidate];
  }
  size_t size() const { return captures_.size(); }
  size_t NumCandidates(size_t capture) const { return captures_[capture].camera_from_target.size(); }

 private:
  // Returns the equations R_M t_Z + k t_M - t_X = R_X t_C of all `chosen`. If k is not free, its term is on the
  // right-hand side.
  TranslationEquations EquationsOf(const Rotations& rotations, const std::vector<Choice>& chosen,
                                   RobotScale scale) const {
    TranslationEquations equations;
    const Eigen::Index rows = 3 * static_cast<Eigen::Index>(chosen.size());
    equations.left.resize(rows, scale == RobotScale::kFree ? 7 : 6);
    equations.right.resize(rows);
    for (size_t i = 0; i < chosen.size(); ++i) {
      const Eigen::Index row = 3 * static_cast<Eigen::Index>(i);
      const Rigid3d& mount = Mount(chosen[i]);
      equations.left.block<3, 3>(row, 0) = mount.RotationMatrix();
      equations.left.block<3, 3>(row, 3) = -Eigen::Matrix3d::Identity();
      equations.right.segment<3>(row) = rotations.x * Seen(chosen[i]).translation;
      if (scale == RobotScale::kFree) {
        equations.left.block<3, 1>(row, 6) = mount.translation;
      } else {
        equations.right.segment<3>(row) -= mount.translation;
      }
    }
    return equations;
  }

  const std::vector<PoseCandidates>& captures_;
};

// Returns three different elements of `from`, which must have at least three.
std::vector<size_t> RandomTriple(const std::vector<size_t>& from, Rng& rng) {
  std::vector<size_t> triple;
  while (triple.size() < 3) {
    const size_t pick = from[static_cast<size_t>(rng.Index(static_cast<int>(from.size())))];
    if (std::find(triple.begin(), triple.end(), pick) == triple.end()) triple.push_back(pick);
  }
  return triple;
}

// Finds the rotations with the smallest 70 % quantile of the misfits, from random triples and then from the captures
// that fit.
std::pair<Rotations, RotationFit> FindRotations(const Solver& solver, Rng& rng) {
  std::vector<size_t> all(solver.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  Rotations best;
  RotationFit fit;
  for (int trial = 0; trial < kNumTriples; ++trial) {
    std::vector<Choice> chosen;
    for (const size_t capture : RandomTriple(all, rng)) {
      // The first candidate is the likeliest.
      const int num = static_cast<int>(solver.NumCandidates(capture));
      const size_t candidate = rng.Uniform() < 0.5 ? 0 : static_cast<size_t>(rng.Index(num));
      chosen.push_back({capture, candidate});
    }
    const Rotations rotations = solver.SolveRotations(chosen);
    RotationFit judged = solver.JudgeRotations(rotations);
    if (judged.typical >= fit.typical) continue;
    best = rotations;
    fit = std::move(judged);
  }
  for (int round = 0; round < kNumRounds; ++round) {
    std::vector<Choice> chosen;
    for (size_t i = 0; i < fit.misfit.size(); ++i) {
      if (fit.misfit[i] <= kFits * fit.typical) chosen.push_back({i, fit.candidate[i]});
    }
    const Rotations rotations = solver.SolveRotations(chosen);
    RotationFit judged = solver.JudgeRotations(rotations);
    if (judged.typical >= fit.typical) break;
    best = rotations;
    fit = std::move(judged);
  }
  return {best, std::move(fit)};
}

}  // namespace

std::optional<PoseConsistency> FindPoseConsistency(const std::vector<PoseCandidates>& captures, RobotScale scale) {
  constexpr size_t kMinCaptures = 5;
  if (captures.size() < kMinCaptures) return std::nullopt;
  const Solver solver(captures);
  Rng rng(1);
  const std::pair<Rotations, RotationFit> found_rotations = FindRotations(solver, rng);
  const Rotations& rotations = found_rotations.first;
  const RotationFit& by_rotation = found_rotations.second;
  if (!std::isfinite(by_rotation.typical)) return std::nullopt;

  std::vector<Choice> choices;
  std::vector<size_t> fitting;
  std::vector<double> distances;
  for (size_t i = 0; i < captures.size(); ++i) {
    choices.push_back({i, by_rotation.candidate[i]});
    if (by_rotation.misfit[i] <= kFits * by_rotation.typical) fitting.push_back(i);
    distances.push_back(solver.Seen(choices.back()).translation.norm());
  }
  Translations best = Translations::Zero();
  std::vector<double> misfits;
  double typical = std::numeric_limits<double>::infinity();
  const auto try_from = [&](const std::vector<Choice>& chosen) {
    const Translations solved = solver.SolveTranslations(rotations, chosen, scale);
    std::vector<double> judged = solver.JudgeTranslations(rotations, solved, choices);
    const double quantile = QuantileOf(judged);
    if (!(quantile < typical)) return false;
    best = solved;
    misfits = std::move(judged);
    typical = quantile;
    return true;
  };
  const auto all_that_fit = [&] {
    std::vector<Choice> chosen;
    for (size_t i = 0; i < misfits.size(); ++i) {
      if (misfits[i] <= kFits * typical) chosen.push_back(choices[i]);
    }
    return chosen;
  };
  std::vector<Choice> all_fitting;
  for (const size_t i : fitting) all_fitting.push_back(choices[i]);
  try_from(all_fitting);
  for (int trial = 0; trial < kNumTriples / 2; ++trial) {
    std::vector<Choice> chosen;
    for (const size_t i : RandomTriple(fitting, rng)) chosen.push_back(choices[i]);
    try_from(chosen);
  }
  for (int round = 0; round < kNumRounds; ++round) {
    if (!try_from(all_that_fit())) break;
  }

  if (!std::isfinite(typical)) return std::nullopt;
  PoseConsistency found;
  found.hand_eye = {Rigid3d(rotations.x, best.segment<3>(3)), Rigid3d(rotations.z, best.head<3>())};
  found.robot_scale = best[6];
  if (scale == RobotScale::kFree) {
    // Estimated from all captures that fit: three captures alone hardly determine the scale.
    const std::vector<Choice> chosen = all_that_fit();
    const Translations solved = solver.SolveTranslations(rotations, chosen, scale);
    found.robot_scale_stddev = solver.ScaleStddev(rotations, solved, chosen);
  }
  const double lever_m = QuantileOf(distances);
  found.rotation_rad = by_rotation.misfit;
  found.translation_m = misfits;
  for (size_t i = 0; i < captures.size(); ++i) {
    found.misfit_m.push_back(std::hypot(misfits[i], lever_m * by_rotation.misfit[i]));
  }
  found.candidate = by_rotation.candidate;
  found.typical_rotation_rad = by_rotation.typical;
  found.typical_translation_m = typical;
  found.typical_misfit_m = QuantileOf(found.misfit_m);
  return found;
}

}  // namespace heba
