#include "solvers/refine/judged_problem.h"

#include "solvers/residuals/inliers.h"

namespace heba {

Problem Without(Problem problem, const ImageSet& images) {
  for (const auto& [capture, image] : images) problem.captures[capture].images[image].observations = Observations();
  return problem;
}

Problem UsedPoints(const Problem& problem, const JudgedProblem& judged) {
  return WithoutRejected(Without(problem, judged.left_out), judged.solution);
}

}  // namespace heba
