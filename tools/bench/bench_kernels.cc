// Benchmarks the inner loops with every instruction set of this machine (Google Benchmark).
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "heba/base/error.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/simd.h"
#include "solvers/closed_form/motion_sums.h"
#include "solvers/residuals/view_reduction.h"
#include "tools/bench/workloads.h"

namespace heba {
namespace {

// Projects all points of a capture, optionally with derivatives.
void BenchProject(benchmark::State& state, const std::string& name, bool with_derivatives) {
  LimitSimd(static_cast<Simd>(state.range(0)));
  const CameraModel& model = *FindCameraModel(name);
  std::vector<double> params(static_cast<size_t>(NumParams(model)), 0.01);
  params[0] = params[1] = 1500;
  params[2] = 800;
  params[3] = 600;
  const BenchScene scene = MakeBenchScene(3, 8);
  const View& view = scene.problem.views.front();
  const Rigid3d camera_from_target = CameraFromTarget(scene.truth, view.camera_mount_from_target_mount);
  ProjectionBatch batch;
  batch.size = view.observations.size();
  for (int row = 0; row < 3; ++row) {
    for (int i = 0; i < batch.size; ++i) batch.points[row][i] = view.observations.points_in_target(row, i);
  }
  PadBatch(&batch);
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  for (const auto _ : state) {
    CHECK(model.ProjectBatch(params.data(), rotation, camera_from_target.translation, with_derivatives, &batch));
    benchmark::DoNotOptimize(batch);
  }
  state.SetItemsProcessed(state.iterations() * batch.size);
}

// Accumulates the normal equations of a capture: all work of a refinement that grows with the number of points.
void BenchMultiplyView(benchmark::State& state, LossKind loss) {
  LimitSimd(static_cast<Simd>(state.range(0)));
  const BenchScene scene = MakeBenchScene(3, static_cast<int>(state.range(1)));
  const View& view = scene.problem.views.front();
  const Rigid3d camera_from_target = CameraFromTarget(scene.truth, view.camera_mount_from_target_mount);
  const Camera& camera = scene.problem.camera;
  const ViewReducer reducer(camera.Model(), FreeParameters(camera.params.size(), true), kBenchNoisePx, LossOf(loss));
  ViewNormalEquations products;
  for (const auto _ : state) {
    CHECK(reducer.Multiply(camera.params.data(), camera_from_target, view.observations, nullptr, &products));
    benchmark::DoNotOptimize(products);
  }
  state.SetItemsProcessed(state.iterations() * view.observations.size());
}

void BenchRootOfProducts(benchmark::State& state) {
  const Eigen::MatrixXd rows = Eigen::MatrixXd::Random(100, state.range(0));
  const Eigen::MatrixXd products = rows.transpose() * rows;
  for (const auto _ : state) benchmark::DoNotOptimize(PivotedCholesky(products));
}

void BenchSumMotions(benchmark::State& state) {
  LimitSimd(static_cast<Simd>(state.range(0)));
  const std::vector<PosePair> pairs = NoisyPairsOf(MakeBenchScene(200, 2));
  for (const auto _ : state) benchmark::DoNotOptimize(SumMotions(pairs));
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(pairs.size() * (pairs.size() - 1) / 2));
}

constexpr auto kBaseline = static_cast<int64_t>(Simd::kBaseline);
constexpr auto kBest = static_cast<int64_t>(Simd::kAvx512);

BENCHMARK_CAPTURE(BenchProject, brown5, "brown5", false)->DenseRange(kBaseline, kBest)->ArgName("set");
BENCHMARK_CAPTURE(BenchProject, brown5_derivatives, "brown5", true)->DenseRange(kBaseline, kBest)->ArgName("set");
BENCHMARK_CAPTURE(BenchProject, rational8_derivatives, "rational8", true)->DenseRange(kBaseline, kBest)->ArgName("set");
BENCHMARK_CAPTURE(BenchProject, kannala_brandt4_derivatives, "kannala_brandt4", true)
    ->DenseRange(kBaseline, kBest)
    ->ArgName("set");
BENCHMARK_CAPTURE(BenchMultiplyView, none, LossKind::kNone)
    ->ArgsProduct({{kBaseline, kBaseline + 1, kBest}, {2, 12}})
    ->ArgNames({"set", "side"});
BENCHMARK_CAPTURE(BenchMultiplyView, cauchy, LossKind::kCauchy)
    ->ArgsProduct({{kBaseline, kBaseline + 1, kBest}, {2, 12}})
    ->ArgNames({"set", "side"});
BENCHMARK(BenchRootOfProducts)->Arg(13)->Arg(22);
BENCHMARK(BenchSumMotions)->DenseRange(kBaseline, kBest)->ArgName("set");

}  // namespace
}  // namespace heba

BENCHMARK_MAIN();
