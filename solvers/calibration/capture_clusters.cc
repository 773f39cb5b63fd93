#include "solvers/calibration/capture_clusters.h"

#include <optional>
#include <utility>

#include "solvers/calibration/problem_model.h"

namespace heba {
namespace {

// Returns whether the noise of no arm rises by more than `most`.
bool HasNoiseOfSameSize(const Solution& solution, const Solution& before, double most) {
  for (size_t r = 0; r < solution.robot_noise.size(); ++r) {
    const std::optional<RobotNoise>& noise = solution.robot_noise[r];
    const std::optional<RobotNoise>& noise_before = before.robot_noise[r];
    if (!noise || !noise_before) continue;
    if (noise->translation_m > most * noise_before->translation_m ||
        noise->rotation_rad > most * noise_before->rotation_rad) {
      return false;
    }
  }
  return true;
}

bool Explains(const JudgedProblem& more, const JudgedProblem& fewer) {
  constexpr double kMostRise = 2;
  return more.left_out.size() < fewer.left_out.size() && more.num_kept_against_test <= fewer.num_kept_against_test &&
         HasNoiseOfSameSize(more.solution, fewer.solution, kMostRise);
}

}  // namespace

JudgedProblem JudgeWithClusters(const Judge& judge, const Problem& problem, JudgedProblem at,
                                const AdjustmentOptions& options) {
  JudgedProblem judged = judge(problem, std::move(at), options);
  if (judged.left_out.size() < 2) return judged;
  Outcome<Solution> of_all = RefineProblem(StartingFrom(problem, judged.solution), judged.solution.poses, options);
  if (!of_all) return judged;
  JudgedProblem from_all = judge(problem, {std::move(*of_all), {}}, options);
  return Explains(from_all, judged) ? from_all : judged;
}

}  // namespace heba
