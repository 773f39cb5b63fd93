// Measures the solver's complete workloads together with a textbook program for Ceres or with OpenCV in the same run,
// and prints the ratios. Each measurement has a process of its own, so that its memory can be measured; figures are
// medians.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/bundle_adjustment.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/simd.h"
#include "heba/pair_cross_validation.h"
#include "heba/refinement.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/study/study.h"
#include "tools/bench/opencv_calibration.h"
#include "tools/bench/textbook_adjustment.h"
#include "tools/bench/textbook_refinement.h"
#include "tools/bench/workloads.h"

DEFINE_int32(repeats, 5, "measurements of each workload; the median is printed");
DEFINE_string(part, "", "one part: refine, rig, intrinsics, closed, holdout or study");
DEFINE_string(only, "", "only the refinements whose names contain this");

namespace heba {
namespace {

struct Workload {
  std::string name;
  int num_captures;
  int points_a_side;
};

struct Measured {
  double seconds = 0;
  double iterations = 0;
  double memory_mb = 0;  // Peak memory in addition to the scene.
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

Measured MiddleOf(std::vector<Measured> all) {
  std::sort(all.begin(), all.end(), [](const Measured& a, const Measured& b) { return a.seconds < b.seconds; });
  return all[all.size() / 2];
}

// Work that takes a fraction of a second is repeated within the process, so that the start of the process, which copies
// each page of memory that it writes, does not count.
Measured Median(const std::function<Measured()>& work) {
  const auto in_one_process = [&] {
    constexpr double kShortS = 0.5;
    constexpr int kAgain = 21;
    Measured first = work();
    if (first.seconds > kShortS) return first;
    std::vector<Measured> all;
    for (int i = 0; i < kAgain; ++i) all.push_back(work());
    return MiddleOf(std::move(all));
  };
  std::vector<Measured> all;
  for (int i = 0; i < FLAGS_repeats; ++i) all.push_back(InOwnProcess(in_one_process));
  return MiddleOf(std::move(all));
}

double SecondsOf(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Measured RunLibrary(const BenchScene& scene, Simd simd, int num_threads, bool has_robot_noise,
                    const std::shared_ptr<const SharedEffects>& effects = nullptr) {
  LimitSimd(simd);
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint, ParameterGroup::kDistortion};
  options.pixel_noise_px = kBenchNoisePx;
  options.num_threads = num_threads;
  options.robot = has_robot_noise ? BundleOptions::Robot::kGivenNoise : BundleOptions::Robot::kExact;
  options.robot_noise = kBenchRobot;
  options.effects = effects;
  Measured measured;
  std::optional<Outcome<PairSolution>> solution;
  measured.seconds = SecondsOf([&] { solution = RefineHandEye(scene.problem, scene.start, options); });
  CHECK(solution->ok()) << solution->reason();
  measured.iterations = (*solution)->convergence.iterations;
  measured.error_mm =
      1000 * DistanceM((*solution)->hand_eye.camera_mount_from_camera, scene.truth.camera_mount_from_camera);
  return measured;
}

Measured RunTextbook(const BenchScene& scene) {
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

void BenchRefinement() {
  std::printf(
      "hand-eye pose, board pose and nine intrinsics, from the check of the initial guess to the covariance\n\n");
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
    const BenchScene scene = MakeBenchScene(workload.num_captures, workload.points_a_side);
    const Measured textbook = Median([&] { return RunTextbook(scene); });
    Print(workload, "textbook Ceres", textbook, textbook.seconds);
    const auto run = [&](const char* name, const BenchScene& with, Simd simd, int num_threads, bool has_robot_noise) {
      Print(workload, name, Median([&] { return RunLibrary(with, simd, num_threads, has_robot_noise); }),
            textbook.seconds);
    };
    run("heba, baseline instructions", scene, Simd::kBaseline, 1, false);
    run("heba, AVX2", scene, Simd::kAvx2, 1, false);
    run("heba, best of machine", scene, Simd::kAvx512, 1, false);
    run("heba, best, 2 threads", scene, Simd::kAvx512, 2, false);
    const BenchScene noisy = MakeBenchScene(workload.num_captures, workload.points_a_side, true);
    run("heba, best, robot corrections", noisy, Simd::kAvx512, 1, true);
    const BenchScene of_arm = WithArmEffects(noisy);
    const auto errors = std::make_shared<const SharedEffects>(ArmErrors(*FindArm("ur5e"), ArmErrorModel::kGeometry));
    Print(workload, "heba, best, corrections and arm",
          Median([&] { return RunLibrary(of_arm, Simd::kAvx512, 1, true, errors); }), textbook.seconds);
  }
  std::printf("\n");
}

AdjustmentOptions BenchCellOptions() {
  LimitSimd(Simd::kAvx512);
  AdjustmentOptions options;
  options.loss = LossKind::kNone;
  options.pixel_noise_px = kBenchNoisePx;
  options.robot = BundleOptions::Robot::kGivenNoise;
  options.robot_noise = kBenchRobot;
  return options;
}

Measured Run(const BenchCell& rig) {
  const AdjustmentOptions options = BenchCellOptions();
  Measured measured;
  std::optional<Outcome<Solution>> solution;
  measured.seconds = SecondsOf([&] { solution = RefineProblem(rig.problem, rig.start, options); });
  CHECK(solution->ok()) << solution->reason();
  measured.iterations = (*solution)->convergence.iterations;
  return measured;
}

TextbookCellState TextbookStart(const BenchCell& rig) {
  TextbookCellState start;
  start.poses = rig.start;
  for (const ProblemCamera& camera : rig.problem.cameras) start.cameras.push_back(camera.camera);
  start.corrections.assign(rig.problem.captures.size(), std::vector<Rigid3d>(rig.problem.robots.size()));
  return start;
}

Measured RunTextbookCell(const BenchCell& rig) {
  const TextbookCellState start = TextbookStart(rig);
  Measured measured;
  TextbookCellResult result;
  measured.seconds = SecondsOf([&] {
    result = RefineCellAsInTextbooks(rig.problem, start, {kBenchNoisePx, kBenchRobot});
  });
  CHECK(result.converged);
  measured.iterations = result.iterations;
  return measured;
}

// Prints how far apart the estimates of both programs are, and the cost of both as the textbook program computes it.
void PrintAgreement(const BenchCell& rig) {
  const Outcome<Solution> ours = RefineProblem(rig.problem, rig.start, BenchCellOptions());
  CHECK(ours.ok()) << ours.reason();
  // With its default tolerance, the textbook program ends a tenth of a sigma before its minimum.
  TextbookCellOptions options{kBenchNoisePx, kBenchRobot};
  options.function_tolerance = 1e-14;
  const TextbookCellResult textbook = RefineCellAsInTextbooks(rig.problem, TextbookStart(rig), options);
  TextbookCellState state{ours->poses, ours->cameras, {}};
  for (const CaptureOutcome& capture : ours->captures) state.corrections.push_back(capture.corrections);
  options.max_iterations = 0;
  const double our_cost = RefineCellAsInTextbooks(rig.problem, state, options).initial_cost;
  double most_sigmas = 0;
  for (size_t c = 0; c < rig.problem.cameras.size(); ++c) {
    const auto covariance = PoseCovarianceOf(ours->covariance, CameraPoseBlock(rig.problem.cameras[c]));
    const Tangent6 apart =
        LocalCoordinates(ours->poses.mount_from_camera[c], textbook.state.poses.mount_from_camera[c]);
    most_sigmas = std::max(most_sigmas, apart.cwiseQuotient(covariance->diagonal().cwiseSqrt()).cwiseAbs().maxCoeff());
  }
  std::printf("cost of heba %.6f, of the textbook program %.6f; the camera poses are at most %.1e sigma apart\n\n",
              our_cost, textbook.final_cost, most_sigmas);
  std::fflush(stdout);
}

// A rig beside the textbook program, with the corrections of the arm's poses and all intrinsics unknown.
void BenchCellAgainstTextbook() {
  constexpr int kSide = 12;
  constexpr int kNumCameras = 4;
  for (const int num_captures : {100, 1000}) {
    const BenchCell rig = MakeBenchCell(kNumCameras, num_captures, kSide);
    std::printf(
        "| %d x %d points x %d cameras, %d observations | ms | its | ms/it | ns/o/i | MB | x textb | x textb/it |\n",
        num_captures, kSide * kSide, kNumCameras, rig.num_observations);
    std::printf("|---|---|---|---|---|---|---|---|\n");
    std::optional<Measured> textbook;
    const auto print = [&](const char* program, const Measured& measured) {
      if (!textbook) textbook = measured;
      const double per_iteration = measured.seconds / measured.iterations;
      std::printf("| %s | %.1f | %.0f | %.2f | %.1f | %.1f | %.1f | %.1f |\n", program, 1e3 * measured.seconds,
                  measured.iterations, 1e3 * per_iteration, 1e9 * per_iteration / rig.num_observations,
                  measured.memory_mb, textbook->seconds / measured.seconds,
                  textbook->seconds / textbook->iterations / per_iteration);
      std::fflush(stdout);
    };
    // One measurement is enough where it takes minutes.
    const auto of_textbook = [&] { return RunTextbookCell(rig); };
    print("textbook Ceres", num_captures < 1000 ? Median(of_textbook) : InOwnProcess(of_textbook));
    print("heba", Median([&] { return Run(rig); }));
    std::printf("\n");
    InOwnProcess([&] {
      PrintAgreement(rig);
      return Measured();
    });
  }
}

// A rig's cost per observation and iteration, beside that of a single camera with the same noise.
void BenchRigs() {
  std::printf("| captures x points x cameras | ms | its | ns/o/i | MB | x single |\n|---|---|---|---|---|---|\n");
  constexpr int kSide = 12;
  double single_ns = 0;
  const auto print = [&](const std::string& name, const Measured& measured, double num_observations) {
    const double ns = 1e9 * measured.seconds / num_observations / std::max(1.0, measured.iterations);
    if (single_ns == 0) single_ns = ns;
    std::printf("| %s | %.1f | %.0f | %.1f | %.1f | %.2f |\n", name.c_str(), 1e3 * measured.seconds,
                measured.iterations, ns, measured.memory_mb, ns / single_ns);
    std::fflush(stdout);
  };
  for (const int num_captures : {100, 1000}) {
    single_ns = 0;
    const std::string captures = std::to_string(num_captures) + " x 144 x ";
    const BenchScene scene = MakeBenchScene(num_captures, kSide, true);
    print(captures + "1, RefineHandEye", Median([&] { return RunLibrary(scene, Simd::kAvx512, 1, true); }),
          num_captures * kSide * kSide);
    for (const int num_cameras : {1, 2, 4}) {
      const BenchCell rig = MakeBenchCell(num_cameras, num_captures, kSide);
      print(captures + std::to_string(num_cameras), Median([&] { return Run(rig); }), rig.num_observations);
    }
  }
  std::printf("\n");
  BenchCellAgainstTextbook();
}

void PrintRow(const char* workload, const char* program, const Measured& measured, double reference_s) {
  std::printf("| %-40s | %-22s | %10.3f | %8.1f | %7.1f |\n", workload, program, 1e3 * measured.seconds,
              measured.memory_mb, reference_s / measured.seconds);
  std::fflush(stdout);
}
void PrintHead(const char* against) {
  std::printf("| workload | program | ms | MB | x %s |\n|---|---|---|---|---|\n", against);
}

Measured Timed(const std::function<void()>& work) {
  Measured measured;
  measured.seconds = SecondsOf(work);
  return measured;
}

void BenchIntrinsics() {
  PrintHead("OpenCV");
  const BenchScene scene = MakeBenchScene(100, 12);
  const Camera& camera = scene.problem.camera;
  const Measured theirs = Median([&] { return Timed([&] { CalibrateCameraWithOpenCv(scene.problem); }); });
  PrintRow("intrinsics from 100 views x 144 points", "cv::calibrateCamera", theirs, theirs.seconds);
  const Measured ours = Median([&] {
    return Timed([&] {
      const Outcome<Camera> found =
          EstimateIntrinsics(scene.problem.views, camera.model, camera.width_px, camera.height_px);
      CHECK(found.ok()) << found.reason();
    });
  });
  PrintRow("intrinsics from 100 views x 144 points", "heba", ours, theirs.seconds);
  std::printf("\n");
}

void BenchClosedForms() {
  PrintHead("OpenCV");
  constexpr const char* kWorkload = "closed forms of 1000 captures";
  const std::vector<PosePair> pairs = NoisyPairsOf(MakeBenchScene(1000, 2));
  double theirs_s = 0;
  for (const char* name : {"tsai", "park", "horaud", "andreff", "daniilidis", "shah", "li"}) {
    const Measured theirs = InOwnProcess([&] { return Timed([&] { SolveHandEyeWithOpenCv(name, pairs); }); });
    const Measured ours =
        Median([&] { return Timed([&] { CHECK(FindHandEyeMethod(name)->solve(pairs).ok()) << name; }); });
    PrintRow(kWorkload, (std::string("OpenCV ") + name).c_str(), theirs, theirs.seconds);
    PrintRow(kWorkload, (std::string("heba ") + name).c_str(), ours, theirs.seconds);
    theirs_s += theirs.seconds;
  }
  const Measured all = Median([&] {
    return Timed([&] {
      const HandEyeInput input(pairs);
      for (const HandEyeMethod& method : HandEyeMethods()) {
        if (method.motion == MethodMotion::kAny) CHECK(method.solve(input).ok()) << method.name;
      }
    });
  });
  PrintRow(kWorkload, "heba, all for any motion", all, theirs_s);
  std::printf("\n");
}

void BenchHoldOut() {
  PrintHead("full");
  const BenchScene scene = MakeBenchScene(30, 12);
  PairCalibrationOptions options = BenchCalibrationOptions(scene);
  for (const bool has_camera : {false, true}) {
    if (has_camera) options.camera = scene.problem.camera;
    const std::string with = has_camera ? ", camera given" : "";
    Outcome<PairCalibration> full = CalibratePair(scene.problem.views, options);
    CHECK(full.ok() && full->refined.ok());
    const Measured once = Median([&] { return Timed([&] { full = CalibratePair(scene.problem.views, options); }); });
    PrintRow(("calibration of 30 x 144" + with).c_str(), "heba", once, once.seconds);
    const Measured folds = Median([&] { return Timed([&] { CrossValidate(*full, options, 5, 1, [] {}); }); });
    PrintRow(("5-fold hold-out, 30 x 144" + with).c_str(), "heba", folds, once.seconds);
  }
  std::printf("\n");
}

void BenchStudy() {
  std::printf("| study of 15 captures x 4 points, all methods | trials/s |\n|---|---|\n");
  for (const bool has_robot_noise : {false, true}) {
    const StudyCell cell = MakeBenchStudyCell(has_robot_noise);
    constexpr int kTrials = 400;
    for (const int num_threads : {1, 2}) {
      const Measured measured = Median([&] {
        return Timed([&] { ParallelFor(kTrials, num_threads, [&](int trial) { RunTrial(cell, 1, trial); }); });
      });
      std::printf("| %s, %d threads | %.0f |\n", has_robot_noise ? "noisy robot" : "exact robot", num_threads,
                  kTrials / measured.seconds);
      std::fflush(stdout);
    }
  }
  std::printf("\n");
}

void Run() {
  std::printf("medians of %d\n\n", FLAGS_repeats);
  const std::vector<std::pair<std::string, void (*)()>> parts = {
      {"refine", &BenchRefinement},  {"rig", &BenchRigs},        {"intrinsics", &BenchIntrinsics},
      {"closed", &BenchClosedForms}, {"holdout", &BenchHoldOut}, {"study", &BenchStudy}};
  for (const auto& [name, bench] : parts) {
    if (FLAGS_part.empty() || FLAGS_part == name) bench();
  }
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  gflags::SetUsageMessage("Measures the solver's workloads against a textbook program and OpenCV.");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  heba::Run();
  return 0;
}
