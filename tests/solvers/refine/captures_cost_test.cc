#include "solvers/refine/captures_cost.h"

#include <functional>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/geometry/pose_block.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/robot_noise.h"
#include "tests/support/linearised_views.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kSigmaPx = 0.3;
constexpr RobotNoise kRobot = {2e-3, 3e-3};

// The shared unknowns of a scene, with a small error.
struct Unknowns {
  PoseBlock hand_eye;
  PoseBlock board;
  std::vector<double> params;
  std::vector<double> shape;  // Empty if the target's shape is known.

  explicit Unknowns(const TestScene& scene)
      : hand_eye(ToBlock(Retract(scene.hand_eye.camera_mount_from_camera, 1e-3 * Tangent6(1, -2, 1, 2, 1, -1)))),
        board(ToBlock(Retract(scene.hand_eye.target_mount_from_target, 1e-3 * Tangent6(-1, 1, 2, 1, -2, 1)))),
        params(scene.camera.params) {}

  std::vector<const double*> Blocks() const {
    std::vector<const double*> blocks = {hand_eye.data(), board.data(), params.data()};
    if (!shape.empty()) blocks.push_back(shape.data());
    return blocks;
  }
  Unknowns Moved(int k, double step) const {
    Unknowns moved = *this;
    const auto retract = [&](PoseBlock* block, int i) {
      *block = ToBlock(Retract(FromBlock(block->data()), step * Tangent6::Unit(i)));
    };
    if (k < 6) {
      retract(&moved.hand_eye, k);
    } else if (k < 12) {
      retract(&moved.board, k - 6);
    } else {
      moved.params[static_cast<size_t>(k - 12)] += step;
    }
    return moved;
  }
};

// Selects what is free besides the poses, and sets the options of the cost.
struct CostOptions {
  FreeParameters free;  // All camera parameters if empty.
  TargetShape shape;
  CapturesCostOptions cost;
};

std::unique_ptr<CapturesCost> MakeCost(const TestScene& scene, const std::string& loss, bool has_corrections,
                                       int num_threads = 1, CostOptions options = {}) {
  options.cost.pixel_sigma_px = kSigmaPx;
  options.cost.loss = &LossOf(*FindLossKind(loss));
  options.cost.num_threads = num_threads;
  if (options.free.empty()) options.free.assign(scene.camera.params.size(), true);
  const PairProblem problem{scene.camera, scene.views, Setup::kEyeToHand, options.shape};
  PoseGroups each;
  for (size_t i = 0; i < scene.views.size(); ++i) each.push_back({i});
  LoopProblem loops = CaptureLoops(HandEyeProblem(problem, {}), each, StateAt(problem, scene.hand_eye),
                                   {{1}, {0}, {kRobot}}, has_corrections);
  loops.layout = HandEyeUnknowns(scene.camera.Model(), options.free);
  // The observations must outlive the cost.
  for (size_t i = 0; i < scene.views.size(); ++i) {
    loops.captures[i].views.front().observations = &scene.views[i].observations;
  }
  return std::make_unique<CapturesCost>(std::move(loops), options.cost);
}

// Returns the eliminated poses of captures that have one each.
std::vector<Rigid3d> PosesOf(const CapturesCost& cost) {
  std::vector<Rigid3d> poses;
  for (const std::vector<Rigid3d>& own : cost.EliminatedPoses()) poses.push_back(own.front());
  return poses;
}

struct Evaluated {
  double cost = 0;
  Eigen::VectorXd gradient;
};
Evaluated Evaluate(const CapturesCost& cost, const Unknowns& unknowns) {
  const std::vector<const double*> blocks = unknowns.Blocks();
  const std::vector<int> sizes = {7, 7, static_cast<int>(unknowns.params.size())};
  Eigen::VectorXd residual(cost.num_residuals());
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  for (const int size : sizes) storage.emplace_back(static_cast<size_t>(size * cost.num_residuals()));
  for (std::vector<double>& block : storage) jacobians.push_back(block.data());
  EXPECT_TRUE(cost.Evaluate(blocks.data(), residual.data(), jacobians.data()));
  Evaluated result;
  result.cost = residual.squaredNorm();
  result.gradient.resize(12 + sizes[2]);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  for (size_t i = 0; i < 3; ++i) {
    const Eigen::Map<RowMajor> jacobian(storage[i].data(), cost.num_residuals(), sizes[i]);
    if (i == 2) {
      result.gradient.tail(sizes[2]) = 2 * jacobian.transpose() * residual;
      continue;
    }
    Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
    PoseManifold().PlusJacobian(blocks[i], plus.data());
    result.gradient.segment<6>(6 * static_cast<Eigen::Index>(i)) = 2 * (jacobian * plus).transpose() * residual;
  }
  return result;
}

// Returns the cost of a view: the sum of rho over its points.
double ViewCost(const CameraModel& model, const std::vector<double>& params, const Rigid3d& camera_from_target,
                const Observations& observations, const std::string& loss) {
  const std::optional<std::vector<double>> squares =
      WhitenedSquares(model, params.data(), camera_from_target, observations, nullptr);
  EXPECT_TRUE(squares.has_value());
  double sum = 0;
  for (const double s : squares.value_or(std::vector<double>()))
    sum += LossOf(*FindLossKind(loss)).rho(s / (kSigmaPx * kSigmaPx));
  return sum;
}

TestScene NoisyScene(const std::function<void(TestSceneOptions*)>& change = {}) {
  TestSceneOptions options;
  options.noise_px = 0.3;
  if (change) change(&options);
  return MakeTestScene(6, options);
}

void ExpectGradient(const std::function<double(const Unknowns&)>& cost_at, const Unknowns& here,
                    const Eigen::VectorXd& gradient) {
  for (int k = 0; k < gradient.size(); ++k) {
    const double step = k < 12 ? 1e-6 : 1e-6 * std::max(1.0, std::abs(here.params[static_cast<size_t>(k - 12)]));
    const double numeric = (cost_at(here.Moved(k, step)) - cost_at(here.Moved(k, -step))) / (2 * step);
    EXPECT_NEAR(gradient[k], numeric, 1e-4 * std::abs(numeric) + 1e-6 * cost_at(here) / step * 1e-3) << k;
  }
}

TEST(CapturesCostTest, IsTheSumOfRhoWithItsGradient) {
  for (const char* loss : {"none", "huber"}) {
    const TestScene scene = NoisyScene();
    const Unknowns here(scene);
    const auto cost_at = [&](const Unknowns& unknowns) {
      double sum = 0;
      for (const View& view : scene.views) {
        const HandEye hand_eye{FromBlock(unknowns.hand_eye.data()), FromBlock(unknowns.board.data())};
        sum += ViewCost(scene.camera.Model(), unknowns.params,
                        CameraFromTarget(hand_eye, view.camera_mount_from_target_mount), view.observations, loss);
      }
      return sum;
    };
    const Evaluated evaluated = Evaluate(*MakeCost(scene, loss, false), here);
    EXPECT_NEAR(evaluated.cost, cost_at(here), 1e-9 * evaluated.cost);
    ExpectGradient(cost_at, here, evaluated.gradient);
  }
}

// Expects that steps of 1e-4 m and rad along each coordinate increase the cost.
void ExpectMinimum(const std::function<double(const Rigid3d&)>& cost_at, const Rigid3d& pose) {
  const double least = cost_at(pose);
  for (int k = 0; k < 6; ++k) {
    for (const double step : {-1e-4, 1e-4}) {
      EXPECT_GT(cost_at(Retract(pose, step * Tangent6::Unit(k))), least) << "coordinate " << k << ", step " << step;
    }
  }
}

TEST(CapturesCostTest, EliminatedPosesMinimiseTheCost) {
  const TestScene scene = NoisyScene();
  const Unknowns here(scene);
  // Each call creates a new cost, which solves for the eliminated poses from their initial guess.
  const auto cost_at = [&](const Unknowns& unknowns) {
    return Evaluate(*MakeCost(scene, "none", true), unknowns).cost;
  };
  const std::unique_ptr<CapturesCost> cost = MakeCost(scene, "none", true);
  const Evaluated evaluated = Evaluate(*cost, here);
  ExpectGradient(cost_at, here, evaluated.gradient);
  // Each eliminated pose minimises the cost of its capture including the prior, and the minima add up to the
  // evaluated cost.
  const std::vector<Rigid3d> corrections = PosesOf(*cost);
  ASSERT_EQ(corrections.size(), scene.views.size());
  const HandEye hand_eye{FromBlock(here.hand_eye.data()), FromBlock(here.board.data())};
  const auto cost_of = [&](size_t i, const Rigid3d& correction) {
    const Rigid3d camera_from_target =
        CameraFromTarget(Setup::kEyeToHand, hand_eye, scene.views[i].camera_mount_from_target_mount, correction);
    return ViewCost(scene.camera.Model(), here.params, camera_from_target, scene.views[i].observations, "none") +
           NuisancePoseResidualAt(correction, CorrectionPrior(kRobot)).residual.squaredNorm();
  };
  double sum = 0;
  for (size_t i = 0; i < corrections.size(); ++i) {
    SCOPED_TRACE(i);
    sum += cost_of(i, corrections[i]);
    ExpectMinimum([&](const Rigid3d& correction) { return cost_of(i, correction); }, corrections[i]);
  }
  EXPECT_NEAR(sum, evaluated.cost, 1e-6 * sum);
  // After a small step the eliminated poses are updated by the linearisation; the cost is nearly that of a solve from
  // their initial guess.
  const Unknowns there = here.Moved(0, 1e-4).Moved(10, -1e-4).Moved(12, 0.5);
  EXPECT_NEAR(Evaluate(*cost, there).cost, cost_at(there), 1e-6 * cost_at(there));
}

// The initial guess of the eliminated poses affects the iterations but not the result. One pose is far off, some are
// so far off that the first step of one of them leads away from the minimum, and the points of one capture are
// collinear.
TEST(CapturesCostTest, EliminatedPosesDoNotDependOnRoughInitialGuesses) {
  TestScene scene = NoisyScene();
  Rigid3d& far_off = scene.views[3].camera_mount_from_target_mount;
  far_off = Retract(far_off, Tangent6(0.02, -0.03, 0.01, 0.1, -0.05, 0.08));
  for (size_t i = 5; i < 12; ++i) {
    Rigid3d& farther_off = scene.views[i].camera_mount_from_target_mount;
    const double size = 0.6 * static_cast<double>(i);
    farther_off = Retract(farther_off, size * Tangent6(0.1, -0.1, 0.1, 0.6, i % 2 == 0 ? 0.4 : -0.4, -0.6));
  }
  std::vector<bool> on_a_line(static_cast<size_t>(scene.views[4].observations.size()), false);
  std::fill_n(on_a_line.begin(), 3, true);
  scene.views[4].observations = KeepPoints(scene.views[4].observations, on_a_line);
  const Unknowns here(scene);
  for (const char* loss : {"none", "huber"}) {
    const std::unique_ptr<CapturesCost> near = MakeCost(scene, loss, true);
    CostOptions options;
    options.cost.eliminated_poses_are_rough = true;
    const std::unique_ptr<CapturesCost> rough = MakeCost(scene, loss, true, 1, options);
    const Evaluated expected = Evaluate(*near, here);
    const Evaluated found = Evaluate(*rough, here);
    EXPECT_NEAR(found.cost, expected.cost, 1e-9 * expected.cost);
    EXPECT_LT((found.gradient - expected.gradient).norm(), 1e-9 * expected.gradient.norm());
    const std::vector<Rigid3d> poses = PosesOf(*near);
    const std::vector<Rigid3d> rough_poses = PosesOf(*rough);
    ASSERT_EQ(rough_poses.size(), poses.size());
    for (size_t i = 0; i < poses.size(); ++i) {
      EXPECT_LT(LocalCoordinates(poses[i], rough_poses[i]).norm(), 1e-9) << loss << " " << i;
    }
  }
}

// Returns a scene whose views have 1 to 48 points, below and above the number of points at which the computation of a
// view changes.
TestScene MixedScene() {
  TestScene scene = NoisyScene([](TestSceneOptions* options) { options->num_captures = 40; });
  const std::vector<int> counts = {1, 4, 16, 17, 48};
  for (size_t i = 0; i < scene.views.size(); ++i) {
    Observations& observations = scene.views[i].observations;
    std::vector<bool> keep(static_cast<size_t>(observations.size()), false);
    std::fill_n(keep.begin(), counts[i % counts.size()], true);
    observations = KeepPoints(observations, keep);
  }
  return scene;
}

// Returns the sum of the views' normal equations, which are formed for each view and transformed by the chain rule as
// a whole.
NormalEquations ChainedProducts(const TestScene& scene, const std::string& loss, const Unknowns& at,
                                const FreeParameters& free, const TargetShape* shape) {
  const ViewReducer reducer(scene.camera.Model(), free, kSigmaPx, LossOf(*FindLossKind(loss)));
  NormalEquations sum;
  sum.matrix = Eigen::MatrixXd::Zero(6 + reducer.num_columns(), 6 + reducer.num_columns());
  for (const View& view : scene.views) {
    const KinematicLoop loop(
        {Inverse(SharedFactor(0)), KnownFactor(view.camera_mount_from_target_mount), SharedFactor(1)});
    LoopDerivatives derivatives;
    const Rigid3d camera_from_target =
        loop.Evaluate({{FromBlock(at.hand_eye.data()), FromBlock(at.board.data())}, {}, {}}, &derivatives);
    ViewNormalEquations products;
    EXPECT_TRUE(reducer.Multiply(at.params.data(), camera_from_target, view.observations, shape, &products));
    Eigen::MatrixXd chain = Eigen::MatrixXd::Zero(products.matrix.cols(), sum.matrix.cols());
    chain.topLeftCorner<6, 6>() = derivatives.shared[0];
    chain.block<6, 6>(0, 6) = derivatives.shared[1];
    chain.bottomRightCorner(products.matrix.cols() - 6, products.matrix.cols() - 6).setIdentity();
    sum.matrix += chain.transpose() * products.matrix * chain;
    sum.loss_remainder += products.loss_remainder;
  }
  return sum;
}

// Returns the largest element of a - b, scaled such that the diagonal of `b` is one.
double LargestDifference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd scale = b.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

// Returns MixedScene() with points of this kind: plain, correlated or discs.
TestScene MixedSceneOf(const std::string& kind) {
  TestScene scene = MixedScene();
  for (View& view : scene.views) {
    Observations& observations = view.observations;
    for (int i = 0; kind == "correlated" && i < observations.size(); ++i) {
      observations.whitening.emplace_back((Eigen::Matrix2d() << 1.1, 0, 0.1 * i, 0.9).finished());
    }
    if (kind == "discs") observations.radii_m = Eigen::VectorXd::Constant(observations.size(), 0.01);
  }
  return scene;
}

// The parameters are the kind of points, the loss, and what is free besides the poses.
class SumOfViewsTest : public testing::TestWithParam<std::tuple<std::string, std::string, std::string>> {};

TEST_P(SumOfViewsTest, IncludesViewsWithFewAndManyPoints) {
  const auto& [kind, loss, what_is_free] = GetParam();
  const TestScene scene = MixedSceneOf(kind);
  CostOptions options;
  for (size_t i = 0; i < scene.camera.params.size(); ++i) {
    options.free.push_back(what_is_free == "every_other" ? i % 2 == 1 : what_is_free != "nothing");
  }
  Unknowns here(scene);
  if (what_is_free == "camera_and_shape") {
    options.free.resize(options.free.size() + TargetShape::kNumParams, true);
    options.shape = DesignedShape(scene.views.back().observations.points_in_target);
    here.shape.assign(options.shape.params.begin(), options.shape.params.end());
  }
  const std::optional<NormalEquations> products =
      MakeCost(scene, loss, false, 1, options)->NormalEquationsAt(here.Blocks().data());
  ASSERT_TRUE(products.has_value());
  const NormalEquations expected =
      ChainedProducts(scene, loss, here, options.free, here.shape.empty() ? nullptr : &options.shape);
  ASSERT_EQ(products->matrix.cols(), expected.matrix.cols());
  EXPECT_LT(LargestDifference(products->matrix, expected.matrix), 1e-12);
  EXPECT_NEAR(products->loss_remainder, expected.loss_remainder, 1e-12 * expected.matrix.rightCols<1>().maxCoeff());
  EXPECT_EQ(products->loss_remainder > 0, loss == "huber");
}

INSTANTIATE_TEST_SUITE_P(, SumOfViewsTest,
                         testing::Combine(testing::Values("plain", "correlated", "discs"),
                                          testing::Values("none", "huber"),
                                          testing::Values("camera", "nothing", "every_other", "camera_and_shape")),
                         [](const auto& test) {
                           return std::get<0>(test.param) + "_loss_" + std::get<1>(test.param) + "_free_" +
                                  std::get<2>(test.param);
                         });

// The parameters say if the captures have corrections and if the camera is free.
class NewtonStepTest : public testing::TestWithParam<std::tuple<bool, bool>> {};

TEST_P(NewtonStepTest, ReducesTheCostAsPredicted) {
  const auto& [has_corrections, all_are_free] = GetParam();
  const TestScene scene = MixedScene();
  const Unknowns here(scene);
  CostOptions options;
  options.free.assign(scene.camera.params.size(), all_are_free);
  const std::unique_ptr<CapturesCost> cost = MakeCost(scene, "none", has_corrections, 1, options);
  const NormalEquations products = *cost->NormalEquationsAt(here.Blocks().data());
  const double start = Evaluate(*MakeCost(scene, "none", has_corrections, 1, options), here).cost;
  const Eigen::Index n = products.matrix.cols() - 1;
  const Eigen::VectorXd scale = products.matrix.diagonal().head(n).cwiseSqrt().cwiseInverse();
  const Eigen::VectorXd step = -(
      scale.asDiagonal() * SolveSymmetric(scale.asDiagonal() * products.matrix.topLeftCorner(n, n) * scale.asDiagonal(),
                                          scale.cwiseProduct(products.matrix.col(n).head(n))));
  const double before = Evaluate(*cost, here).cost;
  const double predicted = cost->PredictedDrop();
  Unknowns there = here;
  for (Eigen::Index k = 0; k < n; ++k) there = there.Moved(static_cast<int>(k), step[k]);
  const double after = Evaluate(*cost, there).cost;
  EXPECT_EQ(before, start);
  // The start is so close to the minimum that the terms beyond the quadratic part are small.
  EXPECT_NEAR(predicted * before, before - after, 0.02 * (before - after));
  EXPECT_GT(predicted, 0.1);
  EXPECT_LT(cost->PredictedDrop(), 0.05 * predicted);  // Only terms of second order are left.
}

INSTANTIATE_TEST_SUITE_P(, NewtonStepTest, testing::Combine(testing::Bool(), testing::Bool()), [](const auto& test) {
  return std::string(std::get<0>(test.param) ? "with_corrections" : "without_corrections") +
         (std::get<1>(test.param) ? "_free_camera" : "_known_camera");
});

TEST(CapturesCostTest, IsBitIdenticalForAnyNumberOfThreads) {
  // There are either many captures with few points, or fewer captures with many points.
  for (const std::pair<int, int>& size : {std::pair{2600, 4}, std::pair{64, 160}}) {
    const int num_captures = size.first;
    const int columns = size.second;
    TestScene scene = NoisyScene([&](TestSceneOptions* options) {
      options->num_captures = 64;
      options->points = GridPoints(columns, 4, 0.6 / columns);
    });
    const size_t num_views = scene.views.size();
    while (scene.views.size() < static_cast<size_t>(num_captures)) {
      scene.views.push_back(scene.views[scene.views.size() % num_views]);
    }
    ASSERT_GT(ThreadsFor(num_captures * 4 * columns, 4), 1);
    const Unknowns here(scene);
    for (const bool has_corrections : {false, true}) {
      const Evaluated one = Evaluate(*MakeCost(scene, "huber", has_corrections, 1), here);
      const Evaluated four = Evaluate(*MakeCost(scene, "huber", has_corrections, 4), here);
      EXPECT_EQ(one.cost, four.cost);
      EXPECT_EQ(one.gradient, four.gradient);
    }
  }
}

TEST(CapturesCostTest, FailsForATargetBehindTheCamera) {
  const TestScene scene = NoisyScene();
  Unknowns behind(scene);
  Rigid3d hand_eye = FromBlock(behind.hand_eye.data());
  hand_eye.rotation = hand_eye.rotation * ExpRotation({0, EIGEN_PI, 0});
  behind.hand_eye = ToBlock(hand_eye);
  for (const bool has_corrections : {false, true}) {
    const std::unique_ptr<CapturesCost> cost = MakeCost(scene, "none", has_corrections);
    std::vector<double> residuals(static_cast<size_t>(cost->num_residuals()));
    EXPECT_FALSE(cost->Evaluate(behind.Blocks().data(), residuals.data(), nullptr));
  }
}

}  // namespace
}  // namespace heba
