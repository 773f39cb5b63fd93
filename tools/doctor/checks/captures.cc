// Checks whether single captures contradict the others, and whether they fit the poses of other captures.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"

namespace heba {
namespace {

std::string ApartText(const PosedImage& a, const PosedImage& b) {
  const Rigid3d& pose = a.base_from_gripper.front();
  const Rigid3d& other = b.base_from_gripper.front();
  return Significant(1000 * DistanceM(pose, other), 2) + " mm and " + Significant(RadToDeg(AngleRad(pose, other)), 2) +
         " deg";
}

// Reports images that occur with several poses (wrong) and copies of a capture (a remark), and returns the views
// without the copies.
Checked SharedImages(const Examination& examination) {
  std::vector<Symptom> symptoms;
  std::set<size_t> copies;
  std::string example;
  const Dataset& data = examination.config.data;
  const auto [images, captures] = PosedImagesOf(data, examination.detections, 0);
  for (const SharedImage& shared : FindSharedImages(images)) {
    if (shared.has_one_pose) {
      if (example.empty()) example = images[shared.images[1]].name + " repeats " + images[shared.images[0]].name;
      for (size_t k = 1; k < shared.images.size(); ++k) copies.insert(captures[shared.images[k]]);
      continue;
    }
    for (size_t k = 1; k < shared.images.size(); ++k) {
      const PosedImage& capture = images[shared.images[k]];
      const PosedImage& other = images[FindOtherPose(images, shared, shared.images[k])];
      symptoms.push_back({Severity::kWrong, "same_picture",
                          capture.name + " is the same image as " + other.name +
                              ", byte by byte, but has another pose of the robot, " + ApartText(capture, other) +
                              " away",
                          "leave out the one whose pose does not belong to the image"});
    }
  }
  if (!copies.empty()) {
    symptoms.push_back({Severity::kRemark, "repeated_image",
                        std::to_string(copies.size()) + " of " + std::to_string(data.captures.size()) +
                            " captures repeat the image of another one, byte by byte, and its pose; for example, " +
                            example,
                        "copies are not used: take more captures instead"});
  }
  std::vector<ExaminedView> views = examination.views;
  std::erase_if(views, [&](const ExaminedView& view) { return copies.count(view.capture) > 0; });
  return {.symptoms = std::move(symptoms), .views = std::move(views)};
}

// Reports images without a pose and poses without an image.
std::vector<Symptom> Unpaired(const RunConfig& config) {
  const auto named = [](const std::vector<std::string>& names) {
    constexpr size_t kMostNamed = 4;
    const std::vector<std::string> first(
        names.begin(), names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kMostNamed)));
    return Join(first, ", ") + (names.size() > kMostNamed ? ", ..." : "");
  };
  std::vector<std::string> texts;
  if (const auto& names = config.images_without_pose; !names.empty()) {
    texts.push_back(std::to_string(names.size()) + " of " + std::to_string(config.num_images) +
                    (names.size() == 1 ? " images has" : " images have") + " no robot pose (" + named(names) + ")");
  }
  if (const auto& names = config.poses_without_image; !names.empty()) {
    texts.push_back(std::to_string(names.size()) + (names.size() == 1 ? " robot pose has" : " robot poses have") +
                    " no image (" + named(names) + ")");
  }
  if (texts.empty()) return {};
  return {{Severity::kRemark, "unpaired", Join(texts, "; ") + "; what is unpaired is not used",
           "complete the poses file if these captures are wanted; list them in captures.exclude if not"}};
}

// Returns the distance between two poses of a target in the unit of PoseConsistency::misfit_m: a rotation counts as
// the displacement that it causes at the target.
double ApartM(const Rigid3d& camera_from_target, const Rigid3d& other) {
  return std::hypot(DistanceM(camera_from_target, other),
                    camera_from_target.translation.norm() * AngleRad(camera_from_target, other));
}

// Reports captures whose robot poses are equal to the last digit, but whose images show the target at different
// positions.
std::vector<Symptom> SamePoses(const std::vector<ExaminedView>& views, double limit_m) {
  std::vector<Symptom> symptoms;
  std::map<std::vector<double>, size_t> first_of;
  for (size_t i = 0; i < views.size(); ++i) {
    const Rigid3d& pose = views[i].view.camera_mount_from_target_mount;
    const Eigen::Vector4d& q = pose.rotation.coeffs();
    const auto [first, is_new] = first_of.emplace(
        std::vector<double>{pose.translation.x(), pose.translation.y(), pose.translation.z(), q[0], q[1], q[2], q[3]},
        i);
    if (is_new) continue;
    const ExaminedView& other = views[first->second];
    double apart_m = std::numeric_limits<double>::infinity();
    for (const Rigid3d& a : views[i].camera_from_target) {
      for (const Rigid3d& b : other.camera_from_target) {
        apart_m = std::min(apart_m, ApartM(a, b));
      }
    }
    if (apart_m <= limit_m) continue;
    symptoms.push_back({Severity::kWrong, "same_pose",
                        other.view.name + " and " + views[i].view.name +
                            " have the same robot pose, to the last digit, but their images show the target " +
                            Significant(1000 * apart_m, 2) + " mm apart",
                        "the pose of one of them belongs to another moment; leave that one out"});
  }
  return symptoms;
}

// Returns the difference between the view and the pose that `mount` predicts.
double MisfitM(const PoseConsistency& consistency, const ExaminedView& view, const Rigid3d& mount) {
  const Rigid3d camera_from_target = CameraFromTarget(consistency.hand_eye, mount);
  double best = std::numeric_limits<double>::infinity();
  for (const Rigid3d& seen : view.camera_from_target) {
    best = std::min(best, ApartM(seen, camera_from_target));
  }
  return best;
}

// A displacement of all poses from one capture on.
struct Jump {
  size_t first = 0;           // The first view after the displacement.
  bool is_at_camera = false;  // Whether it is in the camera's mount (the base, if the camera is fixed).
  Rigid3d displacement;       // Recorded from expected pose: in the camera's mount, or in the target's.
  size_t num_explained = 0;
  double typical_misfit_m = 0;  // The misfit of the captures without a displacement.
};

// Returns the displacement that most of some poses share, and how many of them do.
std::pair<Rigid3d, size_t> CommonDisplacement(const std::vector<Rigid3d>& displacements, double distance_m,
                                              double limit_m) {
  std::pair<Rigid3d, size_t> most{Rigid3d(), 0};
  for (const Rigid3d& centre : displacements) {
    const auto count =
        static_cast<size_t>(std::count_if(displacements.begin(), displacements.end(), [&](const Rigid3d& other) {
          return std::hypot(DistanceM(centre, other), distance_m * AngleRad(centre, other)) < limit_m;
        }));
    if (count > most.second) most = {centre, count};
  }
  return most;
}

// Returns how much larger misfits are at captures that a fit has not seen than at those that it has: it determines the
// twelve parameters of two poses from six coordinates of each capture.
double GrowthOfMisfits(size_t num_fitted) {
  const double leverage = std::min(0.9, 2.0 / static_cast<double>(num_fitted));
  return std::sqrt((1 + leverage) / (1 - leverage));
}

// Returns the jump at which the captures fall into two parts that each fit, and together fit if the poses of one are
// displaced; nothing if there is none.
std::optional<Jump> FindJump(const std::vector<ExaminedView>& views, double distance_m) {
  constexpr size_t kFewestInPart = 3;
  constexpr size_t kFewestForFit = 5;
  constexpr size_t kMostTried = 60;
  constexpr double kGoodShare = 0.01;
  constexpr double kMostExplained = 0.9;
  constexpr double kOutside = 6;
  const size_t n = views.size();
  std::optional<Jump> best;
  const size_t step = std::max<size_t>(1, n / kMostTried);
  for (size_t split = kFewestInPart; split + kFewestInPart <= n; split += step) {
    const bool is_fit_before = 2 * split >= n;
    const std::vector<ExaminedView> before(views.begin(), views.begin() + static_cast<std::ptrdiff_t>(split));
    const std::vector<ExaminedView> after(views.begin() + static_cast<std::ptrdiff_t>(split), views.end());
    const std::vector<ExaminedView>& fitted = is_fit_before ? before : after;
    const std::vector<ExaminedView>& displaced = is_fit_before ? after : before;
    if (fitted.size() < kFewestForFit) continue;
    const std::optional<PoseConsistency> fit = FindPoseConsistency(CandidatesOf(fitted), RobotScale::kOne);
    if (!fit || fit->typical_misfit_m > kGoodShare * distance_m) continue;
    const double limit_m =
        std::max(kOutside * GrowthOfMisfits(fitted.size()) * fit->typical_misfit_m, 0.25 * kGoodShare * distance_m);
    const auto num_fitted = static_cast<size_t>(
        std::count_if(fit->misfit_m.begin(), fit->misfit_m.end(), [&](double misfit_m) { return misfit_m < limit_m; }));
    std::vector<Rigid3d> at_camera;
    std::vector<Rigid3d> at_target;
    for (const ExaminedView& view : displaced) {
      const Rigid3d& recorded = view.view.camera_mount_from_target_mount;
      // The target may look alike in several poses: the one that needs the least displacement is taken.
      const auto expected_of = [&](const Rigid3d& camera_from_target) {
        return fit->hand_eye.camera_mount_from_camera * camera_from_target *
               Inverse(fit->hand_eye.target_mount_from_target);
      };
      const auto is_nearer = [&](const Rigid3d& a, const Rigid3d& b) {
        const auto apart_m = [&](const Rigid3d& one) {
          const Rigid3d expected = expected_of(one);
          return std::hypot(DistanceM(expected, recorded), distance_m * AngleRad(expected, recorded));
        };
        return apart_m(a) < apart_m(b);
      };
      const Rigid3d expected =
          expected_of(*std::min_element(view.camera_from_target.begin(), view.camera_from_target.end(), is_nearer));
      // If the later poses are the fitted ones, the earlier ones are displaced the other way.
      const Rigid3d& from = is_fit_before ? expected : recorded;
      const Rigid3d& to = is_fit_before ? recorded : expected;
      at_camera.push_back(to * Inverse(from));
      at_target.push_back(Inverse(from) * to);
    }
    for (const bool is_at_camera : {true, false}) {
      const auto [displacement, count] = CommonDisplacement(is_at_camera ? at_camera : at_target, distance_m, limit_m);
      const size_t num_explained = num_fitted + count;
      const bool is_large =
          std::hypot(displacement.translation.norm(), distance_m * RotationAngle(displacement.rotation)) > limit_m;
      const bool explains_most = static_cast<double>(num_explained) >= kMostExplained * static_cast<double>(n);
      if (count < kFewestInPart || !is_large || !explains_most) continue;
      if (best && num_explained <= best->num_explained) continue;
      best = Jump{split, is_at_camera, displacement, num_explained, fit->typical_misfit_m};
    }
  }
  return best;
}

Symptom JumpSymptom(const Jump& jump, const std::vector<ExaminedView>& views, Setup setup) {
  // The camera's mount is the base if the camera is fixed.
  const bool is_base = jump.is_at_camera == (setup == Setup::kEyeToHand);
  const Eigen::Vector3d mm = 1000 * jump.displacement.translation;
  const std::string& before = views[jump.first - 1].view.name;
  const std::string& first = views[jump.first].view.name;
  std::vector<std::string> parts;
  for (const double part_mm : mm) parts.push_back(Fixed(part_mm, 1));
  return {Severity::kWrong, "poses_jump",
          "from " + first + " on, the robot's poses are displaced against the images by [" + Join(parts, ", ") +
              "] mm and " + Significant(RadToDeg(RotationAngle(jump.displacement.rotation)), 2) +
              " deg in the frame of the " + (is_base ? "base" : "gripper") +
              "; with this displacement, robot and images differ by " + Significant(1000 * jump.typical_misfit_m, 2) +
              " mm",
          std::string("between ") + before + " and " + first + ", " +
              (is_base ? "the base or user frame of the poses was changed, or what stands in the cell was moved"
                       : "the tool frame of the poses was changed, or what the gripper carries was moved") +
              ": correct the poses, or leave out one part (captures.exclude)"};
}

// Misfits below this share of the working distance are no reason to look for a fault.
constexpr double kLeastShare = 0.01;

// Returns whether several captures are displaced by more than noise.
bool HasSeveralOutside(const PoseConsistency& consistency, double distance_m) {
  constexpr auto kSeveral = 3;
  const auto num_outside = std::count_if(consistency.misfit_m.begin(), consistency.misfit_m.end(),
                                         [&](double misfit_m) { return misfit_m > kLeastShare * distance_m; });
  return num_outside >= kSeveral;
}

// The misfit beyond which a view contradicts the others, and the one below which it fits a pose well.
struct MisfitLimits {
  double outside_m = 0;
  double inside_m = 0;
};

MisfitLimits LimitsOf(double typical_misfit_m, double distance_m) {
  constexpr double kOutside = 6;
  constexpr double kInside = 3;
  return {std::max(kOutside * typical_misfit_m, kLeastShare * distance_m),
          std::max(kInside * typical_misfit_m, 0.25 * kLeastShare * distance_m)};
}

// Returns the views that contradict the others, in their order.
std::vector<size_t> OutsideOf(const PoseConsistency& consistency, double limit_m) {
  std::vector<size_t> outside;
  for (size_t i = 0; i < consistency.misfit_m.size(); ++i) {
    if (consistency.misfit_m[i] > limit_m) outside.push_back(i);
  }
  return outside;
}

// Returns the other view whose pose the image of view i would fit, preferably one that does not fit its own pose;
// nothing if it fits none.
std::optional<size_t> FindPoseFor(size_t i, const PoseConsistency& consistency, const std::vector<ExaminedView>& views,
                                  const std::vector<size_t>& outside, const MisfitLimits& limits) {
  std::optional<size_t> best;
  double best_share = 1;
  for (size_t j = 0; j < views.size(); ++j) {
    if (j == i) continue;
    const double misfit_m = MisfitM(consistency, views[i], views[j].view.camera_mount_from_target_mount);
    const bool is_outside = std::find(outside.begin(), outside.end(), j) != outside.end();
    const double share = misfit_m / (is_outside ? limits.outside_m : limits.inside_m);
    if (share >= best_share) continue;
    best_share = share;
    best = j;
  }
  return best;
}

Symptom SwappedSymptom(const std::string& name, const std::string& other, const std::string& evidence) {
  Symptom symptom{Severity::kWrong, "swapped",
                  name + " and " + other + " are swapped: each fits the other's pose; " + evidence,
                  "swap their names in the poses file"};
  symptom.captures = {name, other};
  return symptom;
}

Symptom WrongPoseSymptom(const std::string& name, const std::string& other, const std::string& evidence) {
  Symptom symptom{Severity::kWrong, "wrong_pose", name + " fits the pose of " + other + "; " + evidence,
                  "look at the two images and at the poses file's lines for them; leave out the one that does not have "
                  "its own pose"};
  symptom.captures = {name};
  return symptom;
}

// Describes the views that contradict the others and fit no other pose.
Symptom ContradictsSymptom(const std::vector<size_t>& alone, const PoseConsistency& consistency,
                           const std::vector<ExaminedView>& views) {
  std::vector<std::string> texts;
  std::vector<std::string> names;
  for (const size_t i : alone) {
    const std::string& name = views[i].view.name;
    texts.push_back(name + " (" + Significant(1000 * consistency.misfit_m[i], 2) + " mm)");
    names.push_back(name);
  }
  Symptom symptom{Severity::kRemark, "contradicts",
                  std::to_string(alone.size()) + (alone.size() == 1 ? " capture contradicts" : " captures contradict") +
                      " the others, which differ from the robot by " +
                      Significant(1000 * consistency.typical_misfit_m, 2) + " mm at the target: " + Join(texts, ", "),
                  "the pose belongs to another moment, the robot had not settled, or the target was misread: leave "
                  "them out or take them again"};
  symptom.captures = std::move(names);
  return symptom;
}

// Reports the views from one on that contradict the others and fit the pose the same number of rows away; nothing if
// there is no such run.
std::optional<Symptom> ShiftFromOn(const PoseConsistency& consistency, const std::vector<ExaminedView>& views,
                                   const MisfitLimits& limits) {
  constexpr size_t kLeastInRun = 3;
  constexpr double kMost = 0.7;  // The share of the run that has to fit.
  const std::vector<size_t> outside = OutsideOf(consistency, limits.outside_m);
  const auto num = static_cast<std::ptrdiff_t>(views.size());
  for (const std::ptrdiff_t step : {1, -1, 2, -2}) {
    const auto fits = [&](size_t i) {
      const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + step;
      return j >= 0 && j < num &&
             MisfitM(consistency, views[i], views[static_cast<size_t>(j)].view.camera_mount_from_target_mount) <
                 limits.outside_m;
    };
    const auto first = std::find_if(outside.begin(), outside.end(), fits);
    const auto num_fitting = static_cast<size_t>(std::count_if(first, outside.end(), fits));
    if (num_fitting < kLeastInRun) continue;
    const double most = kMost * static_cast<double>(views.size() - *first);
    if (static_cast<double>(num_fitting) < most) continue;
    // Where rows change places, images fit the poses of rows in the other direction, too.
    const bool is_permuted = std::any_of(outside.begin(), outside.end(), [&](size_t i) {
      if (fits(i)) return false;
      const std::optional<size_t> j = FindPoseFor(i, consistency, views, outside, limits);
      return j && *j >= *first;
    });
    if (is_permuted) continue;
    const std::string& name = views[*first].view.name;
    Symptom symptom{Severity::kWrong, "pairing",
                    "images and poses are paired wrongly: " + ShiftedFromOnText(name, step),
                    "correct the rows of the poses file, and name the image of each in a column image"};
    symptom.evidence = std::to_string(num_fitting) + " of the " + std::to_string(views.size() - *first) +
                       " images from there on fit the pose of that row, the others are off by " +
                       Significant(1000 * consistency.typical_misfit_m, 2) + " mm at the target";
    symptom.reading = ShiftedFromOnText(name, step);
    for (auto i = first; i != outside.end(); ++i) symptom.captures.push_back(views[*i].view.name);
    return symptom;
  }
  return std::nullopt;
}

// Reports the views that contradict the others: one by one if they fit the pose of another view, else together.
std::vector<Symptom> WrongPoses(const PoseConsistency& consistency, const std::vector<ExaminedView>& views,
                                const MisfitLimits& limits) {
  std::vector<size_t> outside = OutsideOf(consistency, limits.outside_m);
  // A list of more captures would not be read.
  constexpr size_t kMostListed = 100;
  outside.resize(std::min(outside.size(), kMostListed));
  std::map<size_t, size_t> belongs;
  for (const size_t i : outside) {
    if (const std::optional<size_t> j = FindPoseFor(i, consistency, views, outside, limits)) belongs[i] = *j;
  }
  std::vector<Symptom> symptoms;
  std::vector<size_t> alone;
  for (const size_t i : outside) {
    const auto found = belongs.find(i);
    if (found == belongs.end()) {
      alone.push_back(i);
      continue;
    }
    const size_t j = found->second;
    const auto back = belongs.find(j);
    const bool is_swapped = back != belongs.end() && back->second == i;
    if (is_swapped && j < i) continue;  // Reported with the other one.
    const std::string& name = views[i].view.name;
    const std::string evidence = "by its own pose, " + name + " is off by " +
                                 Significant(1000 * consistency.misfit_m[i], 2) + " mm at the target, the others by " +
                                 Significant(1000 * consistency.typical_misfit_m, 2) + " mm";
    const std::string& other = views[j].view.name;
    symptoms.push_back(is_swapped ? SwappedSymptom(name, other, evidence) : WrongPoseSymptom(name, other, evidence));
  }
  if (!alone.empty()) symptoms.push_back(ContradictsSymptom(alone, consistency, views));
  return symptoms;
}

// Reports views that contradict the others, singly or from one on.
std::vector<Symptom> SymptomsOfViews(const std::vector<ExaminedView>& views, Setup setup) {
  const std::optional<PoseConsistency> consistency = FindPoseConsistency(CandidatesOf(views), RobotScale::kOne);
  if (!consistency) return {};
  const double distance_m = WorkingDistanceM(views);
  if (HasSeveralOutside(*consistency, distance_m)) {
    if (const std::optional<Jump> jump = FindJump(views, distance_m)) {
      return {JumpSymptom(*jump, views, setup)};
    }
  }
  // If nothing fits, there are no outliers.
  if (consistency->typical_misfit_m > kPoorShare * distance_m) return {};
  const MisfitLimits limits = LimitsOf(consistency->typical_misfit_m, distance_m);
  if (std::optional<Symptom> shifted = ShiftFromOn(*consistency, views, limits)) {
    return {std::move(*shifted)};
  }
  std::vector<Symptom> symptoms = SamePoses(views, limits.outside_m);
  for (Symptom& symptom : WrongPoses(*consistency, views, limits)) symptoms.push_back(std::move(symptom));
  return symptoms;
}

}  // namespace

Checked Check_captures(const Examination& examination) {
  Checked checked = SharedImages(examination);
  for (Symptom& symptom : SymptomsOfViews(*checked.views, SetupOf(examination.config.data))) {
    checked.symptoms.push_back(std::move(symptom));
  }
  std::vector<Symptom> unpaired = Unpaired(examination.config);
  checked.symptoms.insert(checked.symptoms.begin(), unpaired.begin(), unpaired.end());
  return checked;
}
}  // namespace heba
