#include "solvers/refine/judged_problem.h"

#include "solvers/residuals/inliers.h"

namespace heba {

RigProblem Without(RigProblem problem, const ImageSet& images) {
  for (const auto& [capture, image] : images) problem.captures[capture].images[image].observations = Observations();
  return problem;
}

RigProblem UsedPoints(const RigProblem& problem, const JudgedRig& judged) {
  return WithoutRejected(Without(problem, judged.left_out), judged.solution);
}

}  // namespace heba
