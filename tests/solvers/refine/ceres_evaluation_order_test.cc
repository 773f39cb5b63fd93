// CapturesCost relies on the order in which ceres::Solve evaluates a cost: its eliminated poses and its cached normal
// equations belong to the point at which the Jacobians were evaluated last.
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include "solvers/refine/captures_cost.h"
#include "solvers/refine/reprojection_problem.h"
#include "tests/support/linearised_views.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// Rosenbrock's valley, which long steps leave, with a region where it cannot be evaluated.
class RecordedValley final : public ceres::SizedCostFunction<2, 2> {
 public:
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const double x = parameters[0][0];
    const double y = parameters[0][1];
    const bool has_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
    ++(has_jacobian ? num_jacobians : num_costs);
    if (x > kWall) {
      ++num_failures;
      return false;
    }
    residuals[0] = 10 * (y - x * x);
    residuals[1] = 1 - x;
    if (!has_jacobian) return true;
    jacobians[0][0] = -20 * x;
    jacobians[0][1] = 10;
    jacobians[0][2] = -1;
    jacobians[0][3] = 0;
    last_jacobian = {x, y};
    return true;
  }

  static constexpr double kWall = 1.2;
  mutable int num_costs = 0;
  mutable int num_jacobians = 0;
  mutable int num_failures = 0;
  mutable std::vector<double> last_jacobian;
};

ceres::Solver::Options OptionsWithRadius(double radius) {
  ceres::Solver::Options options = ReprojectionSolverOptions(200);
  options.initial_trust_region_radius = radius;
  return options;
}

ceres::Solver::Summary SolveValley(const ceres::Solver::Options& options, RecordedValley* valley,
                                   std::vector<double>* x) {
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  problem.AddResidualBlock(valley, nullptr, x->data());
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

struct End {
  std::string name;
  std::function<void(ceres::Solver::Options*)> set;
};

class CeresEvaluationOrderTest : public testing::TestWithParam<End> {};

TEST_P(CeresEvaluationOrderTest, JacobiansAreEvaluatedLastAtTheSolution) {
  for (const double radius : {1e-2, 1e2, 1e6}) {
    RecordedValley valley;
    std::vector<double> x = {-1.2, 1.0};
    ceres::Solver::Options options = OptionsWithRadius(radius);
    GetParam().set(&options);
    const ceres::Solver::Summary summary = SolveValley(options, &valley, &x);
    ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
    EXPECT_EQ(valley.last_jacobian, x) << radius << ": " << summary.message;
    EXPECT_GT(valley.num_jacobians, 1);
  }
}

class StopLater final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    return iteration.iteration >= 6 ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }
};

std::vector<End> Ends() {
  static StopLater stop;
  const auto only = [](ceres::Solver::Options* options, double function, double parameter, double gradient) {
    options->function_tolerance = function;
    options->parameter_tolerance = parameter;
    options->gradient_tolerance = gradient;
  };
  return {{"function_tolerance", [only](auto* options) { only(options, 1e-3, 0, 0); }},
          {"parameter_tolerance", [only](auto* options) { only(options, 0, 1e-3, 0); }},
          {"gradient_tolerance", [only](auto* options) { only(options, 0, 0, 1e-3); }},
          {"iterations", [](auto* options) { options->max_num_iterations = 7; }},
          {"callback", [](auto* options) { options->callbacks.push_back(&stop); }}};
}

INSTANTIATE_TEST_SUITE_P(, CeresEvaluationOrderTest, testing::ValuesIn(Ends()),
                         [](const auto& test) { return test.param.name; });

// Some steps of the valley are rejected and some cannot be evaluated; otherwise the test above would prove little.
TEST(RecordedValleyTest, TheValleyRejectsSteps) {
  RecordedValley valley;
  std::vector<double> x = {-1.2, 1.0};
  const ceres::Solver::Summary summary = SolveValley(OptionsWithRadius(1e2), &valley, &x);
  EXPECT_GT(summary.num_unsuccessful_steps, 0);
}

// The same with the cost of captures, with and without eliminated poses, with a far start.
TEST(AcceptedEquationsTest, AreThoseOfTheSolution) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.3;
  scene_options.robot_translation_m = 5e-4;
  scene_options.robot_rotation_rad = 5e-4;
  const TestScene scene = MakeTestScene(8, scene_options);
  const PairProblem problem{scene.camera, scene.views};
  PoseGroups each;
  for (size_t i = 0; i < scene.views.size(); ++i) each.push_back({i});
  HandEye start = scene.hand_eye;
  start.camera_mount_from_camera = Retract(start.camera_mount_from_camera, 0.05 * Tangent6(1, -1, 1, 1, 1, -1));
  for (const bool has_corrections : {false, true}) {
    for (const int max_iterations : {2, 100}) {
      const Problem whole = HandEyeProblem(problem, {});
      const FitState state = StateAt(problem, start);
      LoopProblem loops = CaptureLoops(whole, each, state, {{1}, {0}, {{5e-4, 5e-4}}}, has_corrections);
      LoopUnknowns unknowns(loops.layout, ValuesOf(state));
      CapturesCostOptions cost_options;
      cost_options.pixel_sigma_px = 0.3;
      cost_options.loss = &LossOf(LossKind::kNone);
      CapturesCost cost(std::move(loops), cost_options);
      const ceres::Solver::Summary summary = SolveCaptures(ReprojectionSolverOptions(max_iterations), &cost, &unknowns);
      ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
      EXPECT_EQ(cost.Accepted().parameters, unknowns.all()) << has_corrections << " " << summary.message;
    }
  }
}

}  // namespace
}  // namespace heba
