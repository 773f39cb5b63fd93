#include "tools/pipeline/session.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/evaluation/metrics.h"
#include "heba/io/pose_source.h"
#include "solvers/calibration/problem_model.h"
#include "tools/config/capture_section.h"
#include "tools/config/robot_section.h"
#include "tools/run/earlier_run.h"
#include "tools/run/smooth_prior.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

// Returns the parts of the run's problem whose change is asked for: lenses and scales of targets, too, are not taken
// for granted.
Problem ProblemOf(const RunResult& result) {
  Problem problem = result.rig;
  problem.captures.clear();
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    problem.cameras[c].camera = result.solution.cameras[c];
    problem.cameras[c].free_intrinsics = BundleOptions().free_intrinsics;
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    std::vector<TargetShapeGroup>& free = problem.targets[t].free_shape;
    free = WithGroup(FreeShapeOf(result, t), TargetShapeGroup::kScale, true);
  }
  return problem;
}

bool IsSamePose(const GivenArmPose& a, const GivenArmPose& b) {
  const bool has_same_joints = a.joints.has_value() == b.joints.has_value() && (!a.joints || *a.joints == *b.joints);
  return has_same_joints && a.base_from_gripper->translation == b.base_from_gripper->translation &&
         a.base_from_gripper->rotation.coeffs() == b.base_from_gripper->rotation.coeffs();
}

bool IsSame(const ArmsAtImage& a, const ArmsAtImage& b) {
  return std::equal(a.begin(), a.end(), b.begin(), &IsSamePose);
}

// Returns a capture at these poses of the arms, with their errors if these are estimated.
ProblemCapture CaptureAt(const RunResult& result, const ArmsAtImage& arms, const std::string& image) {
  const Problem& rig = result.rig;
  ProblemCapture capture;
  capture.name = image;
  bool has_postures = false;
  for (size_t r = 0; r < arms.size(); ++r) {
    const Outcome<StatedPose> stated =
        WithErrorsOfArm(FindEstimatedArm(result, r), *arms[r].base_from_gripper, arms[r].joints);
    const std::string& name = rig.robots[r];
    if (!stated) {
      throw InputError(image + ": the joints of the arm" + (name.empty() ? "" : " " + name) + ": " +
                       FailureText(stated.failure()));
    }
    capture.base_from_gripper.push_back(stated->base_from_mount);
    capture.postures.push_back({stated->gripper_by_joints, {}});
    has_postures = has_postures || stated->gripper_by_joints.cols() > 0;
    const SharedEffects* const effects = EffectsOf(rig, r);
    std::vector<int> estimated;
    for (size_t k = 0; effects != nullptr && k < effects->effects.size(); ++k) {
      estimated.push_back(effects->effects[k].index);
    }
    const bool has_effect = effects != nullptr && stated->effect != nullptr;
    capture.effects.push_back(has_effect ? SelectEffects(stated->effect, effects->num_all, estimated) : nullptr);
  }
  if (!has_postures) capture.postures.clear();
  if (rig.effects.empty()) capture.effects.clear();
  return capture;
}

}  // namespace

Observations InPredictedOrder(const Camera& camera, const std::vector<Rigid3d>& symmetries, const TargetShape& shape,
                              const Rigid3d& predicted, const Observations& seen) {
  const Observations* best = nullptr;
  double least_px = 0;
  std::vector<Observations> orders;
  for (const Rigid3d& symmetry : symmetries) {
    Observations& order = orders.emplace_back(seen);
    order.points_in_target = (symmetry.RotationMatrix() * seen.points_in_target).colwise() + symmetry.translation;
  }
  for (const Observations& order : orders) {
    const std::optional<SquaredErrors> errors = ViewErrors(camera, predicted, ApplyShape(order, shape));
    const std::optional<double> rms_px = errors ? errors->RmsPx() : std::nullopt;
    if (!rms_px || (best != nullptr && *rms_px >= least_px)) continue;
    best = &order;
    least_px = *rms_px;
  }
  return best != nullptr ? *best : seen;
}

std::vector<GivenArmPose> PosesOfImages(const FinishedRun& run, size_t robot, const std::filesystem::path& poses,
                                        const std::filesystem::path& joints, const std::vector<SessionImage>& images) {
  const PoseReading& reading = run.pose_readings[robot];
  const std::vector<PoseRow> rows = ReadPoses(poses, reading.format);
  std::map<std::string, const PoseRow*> row_of;
  for (const PoseRow& row : rows) {
    if (!row.image.empty()) row_of.emplace(row.image, &row);
  }
  if (row_of.empty() && rows.size() != images.size()) {
    throw InputError(poses.string() + ": has " + std::to_string(rows.size()) + " rows for " +
                     std::to_string(images.size()) + " images; a column image would say which belong together");
  }
  // An image of each camera may have one name; two of one camera would be one row.
  std::set<std::pair<size_t, std::string>> names;
  for (const SessionImage& image : images) {
    if (names.emplace(image.camera, image.path.filename().string()).second || row_of.empty()) continue;
    throw InputError(image.path.string() + ": another image has this name, too, so that " + poses.string() +
                     " does not tell their poses apart; rename one");
  }
  const RobotSummary* const arm = FindEstimatedArm(run.result, robot);
  std::vector<GivenArmPose> given;
  for (size_t i = 0; i < images.size(); ++i) {
    const PoseRow* row = row_of.empty() ? &rows[i] : nullptr;
    if (row == nullptr) {
      const std::filesystem::path& path = images[i].path;
      auto found = row_of.find(path.filename().string());
      if (found == row_of.end()) found = row_of.find(path.stem().string());
      if (found == row_of.end()) throw InputError(poses.string() + ": has no row for the image " + path.string());
      row = found->second;
    }
    GivenArmPose& pose = given.emplace_back();
    pose.base_from_gripper = BaseFromGripper(reading, row->pose);
    if (arm != nullptr && IsOfJoints(reading.format, arm->nominal)) {
      const std::vector<double> of_row = JointsOfNumbers(arm->nominal, reading.format, row->numbers);
      pose.joints = Eigen::Map<const Eigen::VectorXd>(of_row.data(), static_cast<Eigen::Index>(of_row.size()));
    }
  }
  if (joints.empty()) return given;
  std::vector<std::string> names_of_images;
  for (const SessionImage& image : images) names_of_images.push_back(image.path.filename().string());
  const std::vector<std::vector<double>> read =
      ReadJoints(arm->nominal, joints, run.joints_are_deg[robot], names_of_images);
  for (size_t i = 0; i < read.size(); ++i) {
    given[i].joints = Eigen::Map<const Eigen::VectorXd>(read[i].data(), static_cast<Eigen::Index>(read[i].size()));
  }
  return given;
}

SeenTargets DetectTargets(const FinishedRun& run, const std::vector<SessionImage>& images, int num_threads) {
  SeenTargets seen(images.size());
  ParallelFor(static_cast<int>(images.size()), num_threads, [&](int index) {
    const auto i = static_cast<size_t>(index);
    for (const std::shared_ptr<const Target>& target : run.targets) {
      seen[i].push_back(DetectFor(run.result.solution.cameras[images[i].camera], *target, images[i].path));
    }
  });
  return seen;
}

Session ReadSession(const FinishedRun& run, const std::vector<SessionImage>& images,
                    const std::vector<ArmsAtImage>& poses, int num_threads) {
  return SessionOf(run, images, poses, DetectTargets(run, images, num_threads));
}

Session SessionOf(const FinishedRun& run, const std::vector<SessionImage>& images,
                  const std::vector<ArmsAtImage>& poses, const SeenTargets& seen) {
  CHECK_EQ(images.size(), poses.size());
  const RunResult& result = run.result;
  Session session;
  session.problem = ProblemOf(result);
  std::vector<ArmsAtImage> of_captures;
  for (size_t i = 0; i < images.size(); ++i) {
    const auto same = std::find_if(of_captures.begin(), of_captures.end(),
                                   [&](const ArmsAtImage& arms) { return IsSame(arms, poses[i]); });
    const auto place = static_cast<size_t>(same - of_captures.begin());
    if (same == of_captures.end()) {
      of_captures.push_back(poses[i]);
      session.problem.captures.push_back(CaptureAt(result, poses[i], images[i].path.string()));
    }
    ProblemCapture& capture = session.problem.captures[place];
    bool shows_target = false;
    for (size_t t = 0; t < run.targets.size(); ++t) {
      const size_t camera = images[i].camera;
      constexpr size_t kFewestPoints = 4;
      if (seen[i][t].ids.size() < kFewestPoints) continue;
      const Rigid3d predicted = CameraFromTarget(session.problem, result.solution.poses, camera, t,
                                                 WithErrors(capture, result.solution.effects));
      capture.images.push_back(
          {camera, t,
           InPredictedOrder(result.solution.cameras[camera], result.rig.targets[t].symmetries,
                            result.solution.shapes[t], predicted, ObservationsOf(*run.targets[t], seen[i][t]))});
      shows_target = true;
    }
    if (shows_target) continue;
    const std::string reason = run.targets.size() == 1 ? seen[i].front().reason : "";
    session.notes.push_back(images[i].path.string() + ": shows no target" + (reason.empty() ? "" : ": " + reason));
  }
  return session;
}

SessionOptions SessionOptionsOf(const FinishedRun& run, bool is_target_in_place) {
  SessionOptions options;
  options.is_target_in_place = is_target_in_place;
  options.wobble = run.wobble;
  options.smooth = SmoothPriorsOf(run.result);
  return options;
}

}  // namespace heba
