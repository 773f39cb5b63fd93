#include "solvers/captures_cost.h"

#include <functional>

#include <gtest/gtest.h>

#include "heba/geometry/pose_block.h"
#include "solvers/view_reduction.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kSigmaPx = 0.3;
constexpr RobotNoise kRobot = {2e-3, 3e-3};

// The shared unknowns of a scene, a little off.
struct Unknowns {
  PoseBlock hand_eye;
  PoseBlock board;
  std::vector<double> params;

  explicit Unknowns(const TestScene& scene)
      : hand_eye(ToBlock(Retract(scene.hand_eye.camera_mount_from_camera, 1e-3 * Tangent6(1, -2, 1, 2, 1, -1)))),
        board(ToBlock(Retract(scene.hand_eye.target_mount_from_target, 1e-3 * Tangent6(-1, 1, 2, 1, -2, 1)))),
        params(scene.camera.params) {}

  std::vector<const double*> Blocks() const { return {hand_eye.data(), board.data(), params.data()}; }
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

std::unique_ptr<CapturesCost> MakeCost(const TestScene& scene, const std::string& loss, bool has_corrections,
                                       int num_threads = 1) {
  CapturesCostOptions options;
  options.pixel_sigma_px = kSigmaPx;
  options.loss = FindLoss(loss);
  options.free.assign(scene.camera.params.size(), true);
  options.has_own_pose = has_corrections;
  if (has_corrections) options.own_pose_prior = kRobot;
  options.num_threads = num_threads;
  std::vector<CaptureTerm> captures;
  for (const View& view : scene.views) {
    const Rigid3d& mount = view.camera_mount_from_target_mount;
    captures.push_back({&view.observations,
                        has_corrections ? MakeCorrectedChain(Setup::kEyeToHand, mount) : MakeHandEyeChain(mount),
                        Rigid3d()});
  }
  return std::make_unique<CapturesCost>(scene.camera.Model(), std::move(captures), options);
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

// The sum of rho of a view's points.
double ViewCost(const CameraModel& model, const std::vector<double>& params, const Rigid3d& camera_from_target,
                const Observations& observations, const std::string& loss) {
  const std::optional<std::vector<double>> squares =
      WhitenedSquares(model, params.data(), camera_from_target, observations, nullptr);
  EXPECT_TRUE(squares.has_value());
  double sum = 0;
  for (const double s : squares.value_or(std::vector<double>())) sum += FindLoss(loss)->rho(s / (kSigmaPx * kSigmaPx));
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

TEST(CapturesCostTest, OwnPosesAreTheBestForTheSharedUnknowns) {
  const TestScene scene = NoisyScene();
  const Unknowns here(scene);
  // Each call a cost of its own: poses are found from the start.
  const auto cost_at = [&](const Unknowns& unknowns) {
    return Evaluate(*MakeCost(scene, "none", true), unknowns).cost;
  };
  const std::unique_ptr<CapturesCost> cost = MakeCost(scene, "none", true);
  const Evaluated evaluated = Evaluate(*cost, here);
  ExpectGradient(cost_at, here, evaluated.gradient);
  // What the poses are, and the prior, by themselves.
  const std::vector<Rigid3d> corrections = cost->OwnPoses();
  ASSERT_EQ(corrections.size(), scene.views.size());
  const HandEye hand_eye{FromBlock(here.hand_eye.data()), FromBlock(here.board.data())};
  const auto cost_of = [&](size_t i, const Rigid3d& correction) {
    const Rigid3d camera_from_target =
        CameraFromTarget(Setup::kEyeToHand, hand_eye, scene.views[i].camera_mount_from_target_mount, correction);
    return ViewCost(scene.camera.Model(), here.params, camera_from_target, scene.views[i].observations, "none") +
           CorrectionPriorAt(correction, kRobot).residual.squaredNorm();
  };
  double sum = 0;
  for (size_t i = 0; i < corrections.size(); ++i) {
    sum += cost_of(i, corrections[i]);
    for (int k = 0; k < 6; ++k) {
      for (const double step : {-1e-4, 1e-4}) {
        EXPECT_GT(cost_of(i, Retract(corrections[i], step * Tangent6::Unit(k))), cost_of(i, corrections[i]));
      }
    }
  }
  EXPECT_NEAR(sum, evaluated.cost, 1e-6 * sum);
  // From there a step goes along: what the linearisation says is nearly what settling from the start says.
  const Unknowns there = here.Moved(0, 1e-4).Moved(10, -1e-4).Moved(12, 0.5);
  EXPECT_NEAR(Evaluate(*cost, there).cost, cost_at(there), 1e-6 * cost_at(there));
}

TEST(CapturesCostTest, HasTheSameBytesForAnyNumberOfThreads) {
  const TestScene scene = NoisyScene();
  const Unknowns here(scene);
  for (const bool has_corrections : {false, true}) {
    const Evaluated one = Evaluate(*MakeCost(scene, "huber", has_corrections, 1), here);
    const Evaluated four = Evaluate(*MakeCost(scene, "huber", has_corrections, 4), here);
    EXPECT_EQ(one.cost, four.cost);
    EXPECT_EQ(one.gradient, four.gradient);
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
