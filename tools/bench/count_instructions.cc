// Runs one workload of fixed size, whose instructions callgrind counts (tests/bench/instructions.sh): unlike
// durations, these counts do not depend on the load of the machine. Without a name it lists the workloads.
#include <cstdio>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/bundle_adjustment.h"
#include "heba/geometry/rigid3.h"
#include "heba/pair_cross_validation.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/initial/intrinsics.h"
#include "targets/render/rendering.h"
#include "tools/bench/target_of.h"
#include "tools/bench/workloads.h"

namespace heba {
namespace {

BundleOptions Refinement(BundleOptions::Robot robot) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.pixel_noise_px = kBenchNoisePx;
  options.robot = robot;
  options.robot_noise = kBenchRobot;
  return options;
}

void Refine(int num_captures, int points_a_side, BundleOptions::Robot robot) {
  const BenchScene scene = MakeBenchScene(num_captures, points_a_side, robot != BundleOptions::Robot::kExact);
  CHECK(RefineHandEye(scene.problem, scene.start, Refinement(robot)).ok());
}

constexpr const char* kTags = "type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 24 mm";
constexpr const char* kDots = "type: coded_board, rows: 3, columns: 4, spacing: 35 mm, dot_diameter: 10 mm";

cv::Mat ImageOf(const Target& target) {
  const Drawing& drawing = target.Draw();
  const Camera camera{"pinhole", 640, 512, {640, 640, 319.5, 255.5}};
  const Eigen::Quaterniond front = drawing.y_up ? ExpRotation({kPi, 0, 0}) : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond rotation = ExpRotation({0.2, -0.1, 0.3}) * front;
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  const Rigid3d camera_from_target(
      rotation, Eigen::Vector3d(0, 0, 0.22) - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.clutter = true;
  options.seed = 1;
  return RenderView(drawing, camera, camera_from_target, options);
}

void Render(const char* keys) { ImageOf(*TargetOf(keys)); }
void Find(const char* keys) {
  const std::unique_ptr<Target> target = TargetOf(keys);
  CHECK_EQ(target->Detect(ImageOf(*target)).ids.size(), target->points().size());
}

struct Workload {
  const char* name;
  void (*run)();
};
constexpr Workload kWorkloads[] = {
    {"nothing", [] {}},
    {"scene_100x144", [] { MakeBenchScene(100, 12); }},
    {"refine_20x4", [] { Refine(20, 2, BundleOptions::Robot::kExact); }},
    {"refine_100x144", [] { Refine(100, 12, BundleOptions::Robot::kExact); }},
    {"refine_robot_100x144", [] { Refine(100, 12, BundleOptions::Robot::kGivenNoise); }},
    {"intrinsics_100x144",
     [] {
       const BenchScene scene = MakeBenchScene(100, 12);
       const Camera& camera = scene.problem.camera;
       CHECK(EstimateIntrinsics(scene.problem.views, camera.model, camera.width_px, camera.height_px).ok());
     }},
    {"closed_forms_200",
     [] {
       const std::vector<PosePair> pairs = NoisyPairsOf(MakeBenchScene(200, 2));
       const HandEyeInput input(pairs);
       for (const HandEyeMethod& method : HandEyeMethods()) {
         if (method.motion == MethodMotion::kAny) CHECK(method.solve(input).ok()) << method.name;
       }
     }},
    {"hold_out_30x144",
     [] {
       const BenchScene scene = MakeBenchScene(30, 12);
       const PairCalibrationOptions options = BenchCalibrationOptions(scene);
       const Outcome<PairCalibration> full = CalibratePair(scene.problem.views, options);
       CHECK(full.ok());
       CrossValidate(*full, options, 5, 1, [] {});
     }},
    {"study_20_trials",
     [] {
       const StudyCell cell = MakeBenchStudyCell(false);
       for (int trial = 0; trial < 20; ++trial) RunTrial(cell, 1, trial);
     }},
    {"study_robot_20_trials",
     [] {
       const StudyCell cell = MakeBenchStudyCell(true);
       for (int trial = 0; trial < 20; ++trial) RunTrial(cell, 1, trial);
     }},
    {"render_tags", [] { Render(kTags); }},
    {"find_tags", [] { Find(kTags); }},
    {"render_dots", [] { Render(kDots); }},
    {"find_dots", [] { Find(kDots); }},
};

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  for (const heba::Workload& workload : heba::kWorkloads) {
    if (argc < 2) std::printf("%s\n", workload.name);
    if (argc == 2 && std::string(argv[1]) == workload.name) {
      workload.run();
      return 0;
    }
  }
  return argc < 2 ? 0 : 1;
}
