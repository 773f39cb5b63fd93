#include "tools/text/plan_text.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

// Returns the number of captures that are not repeated ones.
size_t NumNew(const CapturePlan& plan) {
  size_t num = 0;
  for (const PlannedCapture& capture : plan.captures) num += capture.repeats ? 0 : 1;
  return num;
}

}  // namespace

std::vector<std::string> PlannedImages(const CapturePlan& plan, const std::vector<std::string>& former_names) {
  size_t last = 0;
  for (const std::string& name : former_names) {
    std::string digits;
    for (const char c : name.substr(0, name.find('.'))) {
      if (c >= '0' && c <= '9') {
        digits += c;
      } else {
        digits.clear();
      }
    }
    constexpr size_t kMostDigits = 9;
    if (!digits.empty() && digits.size() <= kMostDigits) last = std::max(last, static_cast<size_t>(std::stoul(digits)));
  }
  std::vector<std::string> images;
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    const std::string number = std::to_string(last + i + 1);
    constexpr size_t kDigits = 3;
    images.push_back(std::string(number.size() < kDigits ? kDigits - number.size() : 0, '0') + number + ".png");
  }
  return images;
}

std::string PlannedNote(const CapturePlan& plan, size_t index, const std::vector<std::string>& images,
                        const std::vector<std::string>& former_names) {
  const PlannedCapture& capture = plan.captures[index];
  std::vector<std::string> notes;
  if (capture.repeats) {
    notes.push_back("as " + (former_names.empty() ? images : former_names)[*capture.repeats]);
  } else if (capture.role != CaptureRole::kNone) {
    notes.emplace_back(RoleName(capture.role));
  }
  const std::string& configuration = capture.posture.configuration;
  if (index > 0 && configuration != plan.captures[index - 1].posture.configuration) notes.push_back(configuration);
  return Join(notes, ", ");
}

std::string ExpectedText(const CapturePlan& plan, size_t after) {
  const PlannedCapture& last = plan.captures[after - 1];
  return "after " + std::to_string(after) + " captures a located target is expected to be known to " +
         ShownAmount(1000 * last.target_m, 2) + " mm, and the pose of the camera to " +
         ShownAmount(1000 * last.position_m, 2) + " mm and " + ShownAmount(RadToDeg(last.orientation_rad), 2) +
         " deg (one sigma, by the calibration alone)";
}

std::string UntoldText(const CapturePlan& plan) {
  std::string text;
  for (const UntoldDirection& untold : plan.untold) {
    std::vector<std::string> numbers;
    for (const double number : untold.in_mount) numbers.push_back(Fixed(number, 2));
    text += (text.empty() ? "these captures hardly tell " : ", nor ") +
            (untold.is_rotation ? std::string("the camera's orientation about [") : "the camera's position along [") +
            Join(numbers, ", ") + "] of what it is mounted on (" +
            (untold.is_rotation ? ShownAmount(RadToDeg(untold.sigma), 2) + " deg"
                                : ShownAmount(1000 * untold.sigma, 2) + " mm") +
            ", one sigma)";
  }
  return text + (text.empty()
                     ? ""
                     : ": turn the gripper about more directions, state the camera (camera.intrinsics), or measure it");
}

std::string EnoughText(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan) {
  std::string text;
  for (const PlacedRequirement& requirement : requirements) {
    // The radius that contains a position whose three coordinates have one sigma.
    const double per_sigma = std::sqrt(ChiSquareQuantile(1 - requirement.confidence, 3) / 3);
    size_t enough = 0;
    for (size_t i = NumNew(plan); i-- > 0 && per_sigma * plan.captures[i].target_m <= requirement.within_m;) {
      enough = i + 1;
    }
    text += (text.empty() ? "" : "; ") +
            (enough > 0 ? std::to_string(enough) + " captures are enough for " : "these captures are not enough for ") +
            Significant(1000 * requirement.within_m, 3) + " mm (" + Significant(100 * requirement.confidence, 3) +
            " %)";
  }
  return text;
}

std::string PlanTable(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan,
                      const std::vector<std::string>& former_names) {
  const std::vector<std::string> images = PlannedImages(plan, former_names);
  std::string text = PadRight("capture", 9) + PadLeft("located target, mm", 20) + PadLeft("camera, mm", 13) +
                     PadLeft("camera, deg", 13) + PadLeft("seen for certain", 18) + "\n";
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    const PlannedCapture& capture = plan.captures[i];
    const std::string note = PlannedNote(plan, i, images, former_names);
    text += PadRight(images[i], 9) + PadLeft(ShownAmount(1000 * capture.target_m, 3), 20) +
            PadLeft(ShownAmount(1000 * capture.position_m, 3), 13) +
            PadLeft(ShownAmount(RadToDeg(capture.orientation_rad), 2), 13) +
            PadLeft(Fixed(100 * capture.visible_share, 0) + " %", 18) + (note.empty() ? "" : "  " + note) + "\n";
  }
  text += ExpectedText(plan, NumNew(plan)) + "\n";
  if (!plan.untold.empty()) text += UntoldText(plan) + "\n";
  const std::string enough = EnoughText(requirements, plan);
  if (!enough.empty()) text += enough + "\n";
  return text;
}

}  // namespace heba
