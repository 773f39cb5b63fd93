#include "solvers/calibration/posture_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr double kImpossible = std::numeric_limits<double>::infinity();

// The whitened equations of one view in one posture: rows * unknowns = offset, and their normal equations. The unknowns
// are those of the views and then the errors of the arm. There are no rows if the posture does not reach the pose.
struct Equations {
  Eigen::MatrixXd rows;
  Eigen::VectorXd offset;
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
};

using JointsOfPostures = std::vector<std::vector<Eigen::VectorXd>>;

// Returns whether a joint turns by more than a quarter from one view to the next; postures whose joints are not known
// differ.
bool TurnsFar(const JointsOfPostures& joints, size_t view, size_t posture, size_t posture_before) {
  const Eigen::VectorXd& to = joints[posture][view];
  const Eigen::VectorXd& from = joints[posture_before][view - 1];
  if (to.size() == 0 || from.size() == 0) return posture != posture_before;
  for (Eigen::Index j = 0; j < to.size(); ++j) {
    if (std::abs(std::remainder(to[j] - from[j], 2 * kPi)) > kPi / 2) return true;
  }
  return false;
}

double NumFarTurns(const JointsOfPostures& joints, const std::vector<size_t>& postures) {
  double num_turns = 0;
  for (size_t i = 1; i < postures.size(); ++i) num_turns += TurnsFar(joints, i, postures[i], postures[i - 1]) ? 1 : 0;
  return num_turns;
}

class PostureSearch {
 public:
  explicit PostureSearch(const PosturesOfCaptures& captures)
      : joints_(captures.joints), num_views_(captures.views.size()), num_postures_(captures.by_errors.size()) {
    const Eigen::Index num_unknowns = captures.views.front().by_unknowns.cols();
    const Eigen::Index num_errors = captures.error_variances.size();
    without_normal_ = Eigen::MatrixXd::Zero(num_unknowns, num_unknowns);
    without_right_ = Eigen::VectorXd::Zero(num_unknowns);
    prior_ = Eigen::VectorXd::Zero(num_unknowns + num_errors);
    prior_.tail(num_errors) = captures.error_variances.cwiseInverse();
    equations_.resize(num_postures_);
    for (size_t i = 0; i < num_views_; ++i) {
      LinearisedView view = captures.views[i];
      view.by_unknowns.conservativeResize(Eigen::NoChange, num_unknowns + 6);
      view.by_unknowns.rightCols<6>() = view.by_effects.middleCols<6>(captures.first_column);
      const RowMajorMatrix whitened = WhitenedRows(view, 1, captures.variances);
      const Eigen::MatrixXd by_unknowns = whitened.leftCols(num_unknowns);
      sum_of_squares_ += whitened.rightCols<1>().squaredNorm();
      without_normal_ += by_unknowns.transpose().lazyProduct(by_unknowns);
      without_right_ += by_unknowns.transpose() * whitened.rightCols<1>();
      for (size_t k = 0; k < num_postures_; ++k) {
        Equations& equations = equations_[k].emplace_back();
        const std::optional<Matrix6X>& by_errors = captures.by_errors[k][i];
        if (!by_errors) continue;
        equations.rows.resize(whitened.rows(), num_unknowns + num_errors);
        equations.rows << by_unknowns, whitened.middleCols<6>(num_unknowns).lazyProduct(*by_errors);
        equations.offset = whitened.rightCols<1>();
        equations.normal = equations.rows.transpose().lazyProduct(equations.rows);
        equations.right = equations.rows.transpose() * equations.offset;
      }
    }
  }

  // A choice of postures and how badly it explains the views: minus twice the logarithm of the likelihood.
  struct Choice {
    std::vector<size_t> postures;
    double misfit = kImpossible;
  };

  // Returns the choice that follows from the errors which these views show in one posture.
  Choice From(size_t posture, size_t first, size_t last) const {
    Choice choice{std::vector<size_t>(num_views_, posture), kImpossible};
    std::vector<bool> is_used(num_views_, false);
    for (size_t i = first; i < last; ++i) {
      is_used[i] = IsPossible(posture, i);
    }
    if (std::count(is_used.begin(), is_used.end(), true) < 2) return choice;
    constexpr int kMaxRounds = 15;
    for (int round = 0; round < kMaxRounds; ++round) {
      Choice next = Best(Solve(choice.postures, is_used));
      const bool is_same = next.postures == choice.postures && round > 0;
      choice = std::move(next);
      is_used.assign(num_views_, true);
      if (is_same) break;
    }
    choice.misfit = Misfit(SystemOf(choice.postures), NumFarTurns(joints_, choice.postures));
    return choice;
  }

  // Changes the posture of a few consecutive views at a time, with the errors that they then show, as long as this
  // explains the views better. Errors that matter in one posture alone are not known before it has been tried.
  Choice Improved(Choice choice) const {
    constexpr size_t kMostLength = 12;
    System system = SystemOf(choice.postures);
    for (size_t round = 0; round < num_views_; ++round) {
      Choice best = choice;
      System of_best;
      for (size_t k = 0; k < num_postures_; ++k) {
        for (size_t first = 0; first < num_views_; ++first) {
          System changed = system;
          std::vector<size_t> postures = choice.postures;
          for (size_t i = first; i < std::min(num_views_, first + kMostLength) && IsPossible(k, i); ++i) {
            changed.Move(equations_[postures[i]][i], equations_[k][i]);
            postures[i] = k;
            const double misfit = Misfit(changed, NumFarTurns(joints_, postures));
            if (misfit >= best.misfit) continue;
            best = {postures, misfit};
            of_best = changed;
          }
        }
      }
      if (best.misfit >= choice.misfit) break;
      choice = std::move(best);
      system = std::move(of_best);
    }
    return choice;
  }

  size_t num_views() const { return num_views_; }
  size_t num_postures() const { return num_postures_; }

 private:
  // The normal equations of all views in their postures.
  struct System {
    Eigen::MatrixXd normal;
    Eigen::VectorXd right;

    void Move(const Equations& from, const Equations& to) {
      normal += to.normal - from.normal;
      right += to.right - from.right;
    }
  };
  System SystemOf(const std::vector<size_t>& postures) const {
    System system{prior_.asDiagonal(), Eigen::VectorXd::Zero(prior_.size())};
    for (size_t i = 0; i < num_views_; ++i) {
      system.normal += equations_[postures[i]][i].normal;
      system.right += equations_[postures[i]][i].right;
    }
    return system;
  }
  // With the variance that the views show, and the price of the jumps.
  double Misfit(const System& system, double num_jumps) const {
    const double squares = std::max(1e-12 * sum_of_squares_,
                                    sum_of_squares_ - system.right.dot(SolveSymmetric(system.normal, system.right)));
    const auto num = static_cast<double>(num_views_);
    return 6 * num * std::log(squares) + 2 * std::log(num + 1) * num_jumps;
  }

  bool IsPossible(size_t posture, size_t view) const { return equations_[posture][view].rows.size() > 0; }

  // Returns the unknowns and errors that these views determine in these postures. The other views, in which nothing is
  // known about the arm, add a part of what they say about the unknowns without its errors.
  Eigen::VectorXd Solve(const std::vector<size_t>& postures, const std::vector<bool>& is_used) const {
    constexpr double kPart = 0.2;
    Eigen::MatrixXd normal = prior_.asDiagonal();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(prior_.size());
    for (size_t i = 0; i < num_views_; ++i) {
      if (!is_used[i]) continue;
      normal += equations_[postures[i]][i].normal;
      right += equations_[postures[i]][i].right;
    }
    if (std::find(is_used.begin(), is_used.end(), false) != is_used.end()) {
      normal.topLeftCorner(without_normal_.rows(), without_normal_.cols()) += kPart * without_normal_;
      right.head(without_right_.size()) += kPart * without_right_;
    }
    return SolveSymmetric(normal, right);
  }

  // Returns the best postures at these unknowns: the path of least cost through the postures of all views (Viterbi).
  Choice Best(const Eigen::VectorXd& solution) const {
    std::vector<std::vector<double>> cost(num_views_, std::vector<double>(num_postures_, kImpossible));
    double least = 0;
    for (size_t i = 0; i < num_views_; ++i) {
      for (size_t k = 0; k < num_postures_; ++k) {
        const Equations& equations = equations_[k][i];
        if (IsPossible(k, i)) cost[i][k] = (equations.rows * solution - equations.offset).squaredNorm();
      }
      least += *std::min_element(cost[i].begin(), cost[i].end());
    }
    // In units of the variance that remains.
    const double dof = 6 * static_cast<double>(num_views_);
    const double jump = 2 * std::log(static_cast<double>(num_views_ + 1)) * std::max(least / dof, 1e-12);
    std::vector<std::vector<size_t>> from(num_views_, std::vector<size_t>(num_postures_, 0));
    std::vector<double> best = cost[0];
    for (size_t i = 1; i < num_views_; ++i) {
      std::vector<double> next(num_postures_, kImpossible);
      for (size_t k = 0; k < num_postures_; ++k) {
        for (size_t before = 0; before < num_postures_; ++before) {
          const double total = best[before] + (TurnsFar(joints_, i, k, before) ? jump : 0) + cost[i][k];
          if (!(total < next[k])) continue;
          next[k] = total;
          from[i][k] = before;
        }
      }
      best = std::move(next);
    }
    Choice choice;
    choice.postures.resize(num_views_);
    size_t at = static_cast<size_t>(std::min_element(best.begin(), best.end()) - best.begin());
    choice.misfit = best[at];
    for (size_t i = num_views_; i-- > 0;) {
      choice.postures[i] = at;
      at = from[i][at];
    }
    return choice;
  }

  const std::vector<std::vector<Eigen::VectorXd>>& joints_;
  size_t num_views_;
  size_t num_postures_;
  Eigen::MatrixXd without_normal_;  // The normal equations of all views without errors of the arm.
  Eigen::VectorXd without_right_;
  double sum_of_squares_ = 0;                      // The sum over the offsets of all views.
  Eigen::VectorXd prior_;                          // The inverse variances of all unknowns.
  std::vector<std::vector<Equations>> equations_;  // By posture and view.
};

}  // namespace

std::vector<size_t> ChoosePostures(const PosturesOfCaptures& captures) {
  CHECK(!captures.views.empty() && !captures.by_errors.empty());
  const PostureSearch search(captures);
  constexpr size_t kLeastWindow = 8;
  const size_t window = std::max(kLeastWindow, search.num_views() / 6);
  PostureSearch::Choice best;
  const auto try_from = [&](size_t posture, size_t first, size_t last) {
    PostureSearch::Choice choice = search.From(posture, first, last);
    if (best.postures.empty() || choice.misfit < best.misfit) best = std::move(choice);
  };
  for (size_t k = 0; k < search.num_postures(); ++k) {
    try_from(k, 0, search.num_views());
    for (size_t first = 0; first + window < search.num_views(); first += window / 2) {
      try_from(k, first, first + window);
    }
  }
  return search.Improved(std::move(best)).postures;
}

double LogPriorOf(const std::vector<size_t>& postures, const PosturesOfCaptures& captures) {
  constexpr double kDecided = 10;
  const auto num_views = static_cast<double>(postures.size());
  const auto num_others = static_cast<double>(std::max<size_t>(captures.joints.size(), 2) - 1);
  double num_changes = 0;
  for (size_t i = 1; i < postures.size(); ++i) num_changes += postures[i] == postures[i - 1] ? 0 : 1;
  return -std::log(num_views + 1) * (NumFarTurns(captures.joints, postures) + num_changes) -
         std::log(num_others) * num_changes - (num_changes > 0 ? kDecided : 0);
}

const std::shared_ptr<const SharedEffects>& ErrorsOfBranches(const ArmErrorModels& arm) {
  return arm.of_branches != nullptr ? arm.of_branches : arm.models.back();
}

PosturesOfCaptures PosturesByErrors(const ArmErrorModels& arm, const std::vector<size_t>& captures) {
  const SharedEffects& errors = *ErrorsOfBranches(arm);
  PosturesOfCaptures postures;
  postures.error_variances.resize(errors.size());
  for (Eigen::Index j = 0; j < errors.size(); ++j) {
    const double sigma = errors.groups[errors.effects[static_cast<size_t>(j)].group].sigma;
    postures.error_variances[j] = sigma * sigma;
  }
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(errors.num_all);
  for (const auto& effects : arm.effects_of_captures) {
    const size_t branch = postures.by_errors.size();
    std::vector<std::optional<Matrix6X>>& of_views = postures.by_errors.emplace_back();
    std::vector<Eigen::VectorXd>& joints = postures.joints.emplace_back();
    for (const size_t i : captures) {
      of_views.emplace_back();
      joints.push_back(arm.positions_of_captures.empty() ? Eigen::VectorXd() : arm.positions_of_captures[branch][i]);
      if (effects[i] == nullptr) continue;
      Matrix6X by_all;
      effects[i]->Evaluate(none, &by_all);
      of_views.back() = Matrix6X(6, errors.size());
      for (Eigen::Index j = 0; j < errors.size(); ++j) {
        of_views.back()->col(j) = by_all.col(errors.effects[static_cast<size_t>(j)].index);
      }
    }
  }
  return postures;
}

std::vector<size_t> BranchesOfAll(const ArmErrorModels& arm, const std::vector<size_t>& captures,
                                  const std::vector<size_t>& branches) {
  CHECK_EQ(captures.size(), branches.size());
  std::vector<size_t> of_all(arm.effects_of_captures.front().size(), branches.front());
  for (size_t i = 0, v = 0; i < of_all.size(); ++i) {
    if (i > 0) of_all[i] = of_all[i - 1];
    if (v < captures.size() && captures[v] == i) of_all[i] = branches[v++];
    for (size_t k = 0; k < arm.effects_of_captures.size() && arm.effects_of_captures[of_all[i]][i] == nullptr; ++k) {
      of_all[i] = k;
    }
  }
  return of_all;
}

}  // namespace heba
