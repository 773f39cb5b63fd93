#include "solvers/initial/pose_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/error.h"
#include "solvers/closed_form/hand_eye_method.h"

namespace heba {
namespace {

// One possible target pose of a view, with the order in which the target was read.
struct Candidate {
  Rigid3d camera_from_target;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance_at_1px;
  int symmetry;
};
using Candidates = std::vector<std::vector<Candidate>>;  // Indexed by view.
using Choice = std::vector<int>;                         // Index of the candidate of each view.

// Returns the angle of the rotation between a and b, rad, from their chord.
double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const double chord2 = std::min((a.coeffs() - b.coeffs()).squaredNorm(), (a.coeffs() + b.coeffs()).squaredNorm());
  return 4 * std::asin(0.5 * std::sqrt(chord2));
}

// Captures vote on how much two of them contradict each other: by the difference between the relative rotation angles
// that the camera and the robot report.
class AngleVote {
 public:
  AngleVote(const std::vector<View>& views, const Candidates& candidates) : views_(views), candidates_(candidates) {
    // This number of voters is sufficient.
    constexpr size_t kMaxVoters = 100;
    const size_t step = (views.size() + kMaxVoters - 1) / kMaxVoters;
    for (size_t i = 0; i < views.size(); i += step) voters_.push_back(i);
  }

  // A choice, and its sum of contradictions, rad.
  struct Weighed {
    Choice choice;
    double total_rad = 0;
  };

  // Returns the choice that agrees best with candidate `a` of view `anchor`, refined view by view until it no longer
  // changes.
  Weighed From(size_t anchor, int a) const {
    const size_t n = candidates_.size();
    Weighed weighed{Choice(n, 0)};
    Choice& choice = weighed.choice;
    choice[anchor] = a;
    for (size_t i = 0; i < n; ++i) {
      if (i != anchor) choice[i] = BestOf(Sums(i, {anchor}, choice));
    }
    constexpr int kMaxSweeps = 10;
    for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
      bool changed = false;
      weighed.total_rad = 0;
      for (size_t i = 0; i < n; ++i) {
        const std::vector<double> sums = Sums(i, voters_, choice);
        const int best = BestOf(sums);
        changed = changed || best != choice[i];
        choice[i] = best;
        weighed.total_rad += sums[static_cast<size_t>(best)];
      }
      if (!changed) break;
    }
    return weighed;
  }

 private:
  // Returns for each candidate of view i the sum of its contradictions with the choices of the other views, rad.
  std::vector<double> Sums(size_t i, const std::vector<size_t>& others, const Choice& choice) const {
    constexpr double kCap = 0.2;  // Limits the influence of a single bad view.
    std::vector<double> sums(candidates_[i].size(), 0.0);
    for (const size_t j : others) {
      if (j == i) continue;
      const double robot_angle = AngleBetween(views_[i].camera_mount_from_target_mount.rotation,
                                              views_[j].camera_mount_from_target_mount.rotation);
      const Eigen::Quaterniond& other = candidates_[j][static_cast<size_t>(choice[j])].camera_from_target.rotation;
      for (size_t a = 0; a < sums.size(); ++a) {
        const double seen_angle = AngleBetween(candidates_[i][a].camera_from_target.rotation, other);
        sums[a] += std::min(kCap, std::abs(robot_angle - seen_angle));
      }
    }
    return sums;
  }
  // Returns the index of the smallest sum. On a tie it is the first, the candidate that fits its own view best.
  static int BestOf(const std::vector<double>& sums) {
    return static_cast<int>(std::min_element(sums.begin(), sums.end()) - sums.begin());
  }

  const std::vector<View>& views_;
  const Candidates& candidates_;
  std::vector<size_t> voters_;
};

std::vector<PosePair> Pairs(const std::vector<View>& views, const Candidates& candidates, const Choice& choice) {
  std::vector<PosePair> pairs;
  for (size_t i = 0; i < views.size(); ++i) {
    const Candidate& candidate = candidates[i][static_cast<size_t>(choice[i])];
    pairs.push_back({views[i].camera_mount_from_target_mount, candidate.camera_from_target, views[i].role,
                     candidate.covariance_at_1px});
  }
  return pairs;
}

// Returns the squared reprojection error of a view, px^2, for one reading order and the pose predicted by the loop.
// The error is capped; it is the cap if a point cannot be projected.
double PredictionError(const Camera& camera, const View& view, const Rigid3d& camera_from_target,
                       const Rigid3d& symmetry) {
  const double cap = std::pow(0.25 * camera.width_px, 2) * view.observations.size();
  const std::optional<SquaredErrors> errors = ViewErrors(camera, camera_from_target * symmetry, view.observations);
  return errors ? std::min(cap, errors->sum_px2) : cap;
}

// Returns the candidates of each view: each of its poses in each reading order, pose by pose.
Candidates CandidatesOf(const std::vector<View>& views, const std::vector<std::vector<TargetPose>>& poses,
                        const std::vector<Rigid3d>& symmetries) {
  Candidates candidates(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    CHECK(!poses[i].empty()) << views[i].name;
    for (const TargetPose& pose : poses[i]) {
      for (size_t s = 0; s < symmetries.size(); ++s) {
        // If S moves the points, the same pixels correspond to the pose times S^-1.
        candidates[i].push_back(
            {pose.camera_from_target * Inverse(symmetries[s]), pose.covariance_at_1px, static_cast<int>(s)});
      }
    }
  }
  return candidates;
}

// Returns the choice for which the captures vote, starting from each pose of a few views; one of these poses is
// correct.
Choice VotedChoice(const std::vector<View>& views, const Candidates& candidates, size_t num_symmetries) {
  const AngleVote vote(views, candidates);
  constexpr size_t kMaxAnchors = 5;
  const size_t step = std::max<size_t>(1, views.size() / kMaxAnchors);
  Choice choice(views.size(), 0);
  double best_total_rad = std::numeric_limits<double>::infinity();
  for (size_t anchor = 0; anchor < views.size(); anchor += step) {
    // The first reading order of each pose suffices.
    for (size_t a = 0; a < candidates[anchor].size(); a += num_symmetries) {
      const AngleVote::Weighed found = vote.From(anchor, static_cast<int>(a));
      if (found.total_rad < best_total_rad - 1e-12) {
        best_total_rad = found.total_rad;
        choice = found.choice;
      }
    }
  }
  return choice;
}

// The choice that fits the predictions of a hand-eye calibration best, and the sum of its PredictionErrors, px^2.
struct PredictedChoice {
  Choice choice;
  double error_px2 = 0;
};

// Returns for each view the reading order that fits its prediction best and, within that order, the pose nearest to the
// prediction.
PredictedChoice PredictChoice(const Camera& camera, const std::vector<View>& views, const Candidates& candidates,
                              const std::vector<Rigid3d>& symmetries, const HandEye& hand_eye) {
  PredictedChoice next{Choice(views.size()), 0};
  for (size_t i = 0; i < views.size(); ++i) {
    const Rigid3d predicted = CameraFromTarget(hand_eye, views[i].camera_mount_from_target_mount);
    std::vector<double> errors;
    for (const Rigid3d& symmetry : symmetries) {
      errors.push_back(PredictionError(camera, views[i], predicted, symmetry));
    }
    const int best = static_cast<int>(std::min_element(errors.begin(), errors.end()) - errors.begin());
    next.error_px2 += errors[static_cast<size_t>(best)];
    double best_angle = std::numeric_limits<double>::infinity();
    for (size_t a = 0; a < candidates[i].size(); ++a) {
      if (candidates[i][a].symmetry != best) continue;
      const double angle = AngleRad(candidates[i][a].camera_from_target, predicted);
      if (angle >= best_angle) continue;
      best_angle = angle;
      next.choice[i] = static_cast<int>(a);
    }
  }
  return next;
}

// The hand-eye calibration of a choice by one method.
struct Solved {
  size_t method;
  Choice choice;
  Outcome<HandEye> hand_eye;
};

}  // namespace

ChosenPoses ChoosePoses(const Camera& camera, const std::vector<View>& views,
                        const std::vector<std::vector<TargetPose>>& poses, const std::vector<Rigid3d>& symmetries) {
  CHECK_EQ(views.size(), poses.size());
  CHECK(!symmetries.empty());
  const Candidates candidates = CandidatesOf(views, poses, symmetries);
  const Choice choice = VotedChoice(views, candidates, symmetries.size());

  // The choice is then refined by calibration, until nothing changes. The method with the smallest error decides.
  Choice best_choice = choice;
  double best_error_px2 = std::numeric_limits<double>::infinity();
  const std::vector<PosePair> voted = Pairs(views, candidates, choice);
  const HandEyeInput voted_input(voted);
  std::vector<Solved> solved;
  for (size_t m = 0; m < HandEyeMethods().size(); ++m) {
    const HandEyeMethod& method = HandEyeMethods()[m];
    Choice current = choice;
    constexpr int kMaxRounds = 10;
    for (int round = 0; round < kMaxRounds; ++round) {
      const Outcome<HandEye> hand_eye =
          current == choice ? method.solve(voted_input) : method.solve(Pairs(views, candidates, current));
      solved.push_back({m, current, hand_eye});
      if (!hand_eye) break;
      const PredictedChoice next = PredictChoice(camera, views, candidates, symmetries, *hand_eye);
      const bool settled = next.choice == current;
      if (next.error_px2 < best_error_px2) {
        best_error_px2 = next.error_px2;
        best_choice = next.choice;
      }
      current = next.choice;
      if (settled) break;
    }
  }

  ChosenPoses chosen;
  chosen.solutions.resize(HandEyeMethods().size());
  for (Solved& entry : solved) {
    if (entry.choice == best_choice) chosen.solutions[entry.method] = std::move(entry.hand_eye);
  }
  chosen.pairs = Pairs(views, candidates, best_choice);
  for (size_t i = 0; i < views.size(); ++i) {
    chosen.symmetry.push_back(candidates[i][static_cast<size_t>(best_choice[i])].symmetry);
  }
  return chosen;
}

const TargetPose* NearestPose(const std::vector<TargetPose>& poses, const Rigid3d& camera_from_target) {
  const auto nearest = std::min_element(poses.begin(), poses.end(), [&](const TargetPose& a, const TargetPose& b) {
    return AngleRad(a.camera_from_target, camera_from_target) < AngleRad(b.camera_from_target, camera_from_target);
  });
  return nearest == poses.end() ? nullptr : &*nearest;
}

std::vector<PosePair> PosePairsOf(const Camera& camera, const HandEye& hand_eye, const std::vector<View>& views) {
  std::vector<PosePair> pairs;
  for (const View& view : views) {
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, view.observations);
    const TargetPose* const nearest =
        NearestPose(poses, CameraFromTarget(hand_eye, view.camera_mount_from_target_mount));
    if (nearest == nullptr) continue;
    pairs.push_back(
        {view.camera_mount_from_target_mount, nearest->camera_from_target, view.role, nearest->covariance_at_1px});
  }
  return pairs;
}

}  // namespace heba
