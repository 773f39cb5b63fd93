// Measures the refinement on whole workloads, beside what a textbook's program for Ceres takes for the same in the same
// run, and prints the ratios. Each measurement has a process of its own, so that its memory is its own; medians.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/base/simd.h"
#include "heba/evaluation/metrics.h"
#include "heba/simulation/scene.h"
#include "solvers/bundle_adjustment.h"
#include "tools/bench/textbook_refinement.h"

DEFINE_int32(repeats, 5, "measurements of each, of which the middle one counts");
DEFINE_string(only, "", "only the workloads whose names contain this");

namespace heba {
namespace {

struct Workload {
  std::string name;
  int num_captures;
  int points_a_side;
};

struct Scene {
  Problem problem;
  HandEye truth;
  HandEye start;
};

constexpr double kNoisePx = 0.1;
constexpr RobotNoise kRobot = {1e-4, 3.5e-4};

Scene MakeScene(const Workload& workload, bool has_robot_noise) {
  Rng rng(1);
  Scene scene;
  scene.problem.camera = {"brown5", 1600, 1200, {1500, 1502, 805, 595, -0.08, 0.05, 0.0005, -0.0003, 0.0}};
  scene.truth = {Rigid3d(ExpRotation({0.4, -1.2, 0.7}), {0.5, -0.3, 0.6}),
                 Rigid3d(ExpRotation({1.0, 0.3, -0.5}), {0.04, -0.02, 0.09})};
  const int side = workload.points_a_side;
  constexpr double kBoardM = 0.2;
  Points3 points(3, side * side);
  for (int i = 0; i < side * side; ++i) {
    points.col(i) << kBoardM * (static_cast<double>(i % side) / (side - 1) - 0.5),
        kBoardM * (static_cast<double>(i / side) / (side - 1) - 0.5), 0;
  }
  MotionOptions motion;
  motion.num_captures = workload.num_captures;
  const Outcome<std::vector<Rigid3d>> poses = SimulatePoses(scene.problem.camera, points, false, motion, &rng);
  CHECK(poses.ok()) << poses.reason();
  for (const Rigid3d& camera_from_target : *poses) {
    const Rigid3d mount = CameraMountFromTargetMount(scene.truth, camera_from_target);
    scene.problem.views.push_back(
        *SimulateView("view", scene.problem.camera, scene.truth, mount, points, kNoisePx, &rng));
    if (has_robot_noise) {
      scene.problem.views.back().camera_mount_from_target_mount =
          WithRobotNoise(mount, kRobot.rotation_rad, kRobot.translation_m, &rng);
    }
  }
  const auto off = [](const Rigid3d& pose, double by) {
    return Retract(pose, by * (Tangent6() << 2, -1, 1, 3, 2, -2).finished());
  };
  scene.start = {off(scene.truth.camera_mount_from_camera, 1e-3), off(scene.truth.target_mount_from_target, -1e-3)};
  return scene;
}

struct Measured {
  double seconds = 0;
  double iterations = 0;
  double memory_mb = 0;  // Beyond what the scene takes.
  double error_mm = 0;
};

double PeakMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// Runs `work` in a process of its own.
Measured InOwnProcess(const std::function<Measured()>& work) {
  int ends[2];
  CHECK_EQ(pipe(ends), 0);
  const pid_t child = fork();
  CHECK_GE(child, 0);
  if (child == 0) {
    const double before_mb = PeakMb();
    Measured measured = work();
    measured.memory_mb = PeakMb() - before_mb;
    const bool is_written = write(ends[1], &measured, sizeof measured) == static_cast<ssize_t>(sizeof measured);
    _exit(is_written ? 0 : 1);
  }
  close(ends[1]);
  Measured measured;
  CHECK_EQ(read(ends[0], &measured, sizeof measured), static_cast<ssize_t>(sizeof measured));
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return measured;
}

Measured Median(const std::function<Measured()>& work) {
  std::vector<Measured> all;
  for (int i = 0; i < FLAGS_repeats; ++i) all.push_back(InOwnProcess(work));
  std::sort(all.begin(), all.end(), [](const Measured& a, const Measured& b) { return a.seconds < b.seconds; });
  return all[all.size() / 2];
}

double SecondsOf(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Measured RunLibrary(const Scene& scene, Simd simd, int num_threads, bool has_robot_noise) {
  LimitSimd(simd);
  BundleOptions options;
  options.loss = "none";
  options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint, ParameterGroup::kDistortion};
  options.pixel_noise_px = kNoisePx;
  options.num_threads = num_threads;
  options.robot = has_robot_noise ? BundleOptions::Robot::kGivenNoise : BundleOptions::Robot::kExact;
  options.robot_noise = kRobot;
  Measured measured;
  std::optional<Outcome<Solution>> solution;
  measured.seconds = SecondsOf([&] { solution = RefineHandEye(scene.problem, scene.start, options); });
  CHECK(solution->ok()) << solution->reason();
  measured.iterations = (*solution)->convergence.iterations;
  measured.error_mm =
      1000 * DistanceM((*solution)->hand_eye.camera_mount_from_camera, scene.truth.camera_mount_from_camera);
  return measured;
}

Measured RunTextbook(const Scene& scene) {
  Measured measured;
  TextbookResult result;
  measured.seconds = SecondsOf([&] { result = RefineAsInTextbooks(scene.problem, scene.start); });
  CHECK(result.converged);
  measured.iterations = result.iterations;
  measured.error_mm = 1000 * DistanceM(result.hand_eye.camera_mount_from_camera, scene.truth.camera_mount_from_camera);
  return measured;
}

void Print(const Workload& workload, const char* program, const Measured& measured, double reference_s) {
  const double num_observations =
      static_cast<double>(workload.num_captures) * workload.points_a_side * workload.points_a_side;
  std::printf("| %-14s | %-30s | %10.3f | %3.0f | %8.1f | %8.1f | %7.1f | %6.4f |\n", workload.name.c_str(), program,
              1e3 * measured.seconds, measured.iterations,
              1e9 * measured.seconds / num_observations / std::max(1.0, measured.iterations), measured.memory_mb,
              reference_s / measured.seconds, measured.error_mm);
  std::fflush(stdout);
}

void Run() {
  std::printf("hand-eye pose, board and nine intrinsics, from the start's check to the covariance; medians of %d\n\n",
              FLAGS_repeats);
  std::printf(
      "| captures x pts | program                        |         ms | its |   ns/o/i |       MB | x textb | "
      "off mm |\n|---|---|---|---|---|---|---|---|\n");
  const std::vector<Workload> workloads = {{"20 x 4", 20, 2},
                                           {"20 x 144", 20, 12},
                                           {"100 x 144", 100, 12},
                                           {"1000 x 144", 1000, 12},
                                           {"10000 x 144", 10000, 12}};
  for (const Workload& workload : workloads) {
    if (workload.name.find(FLAGS_only) == std::string::npos) continue;
    const Scene scene = MakeScene(workload, false);
    const Measured textbook = Median([&] { return RunTextbook(scene); });
    Print(workload, "textbook Ceres", textbook, textbook.seconds);
    const auto run = [&](const char* name, const Scene& with, Simd simd, int num_threads, bool has_robot_noise) {
      Print(workload, name, Median([&] { return RunLibrary(with, simd, num_threads, has_robot_noise); }),
            textbook.seconds);
    };
    run("heba, baseline instructions", scene, Simd::kBaseline, 1, false);
    run("heba, AVX2", scene, Simd::kAvx2, 1, false);
    run("heba, best of machine", scene, Simd::kAvx512, 1, false);
    run("heba, best, 2 threads", scene, Simd::kAvx512, 2, false);
    const Scene noisy = MakeScene(workload, true);
    run("heba, best, robot corrections", noisy, Simd::kAvx512, 1, true);
  }
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::SetUsageMessage("Measures the refinement on whole workloads beside a textbook's program.");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  heba::Run();
  return 0;
}
