#include "tools/doctor/symptom.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>

#include "heba/base/error.h"

namespace heba {

SymptomCode SymptomCode::OfFinding(const Finding& finding) {
  const auto known = std::find(std::begin(kFindingCodes), std::end(kFindingCodes), finding.code);
  CHECK(known != std::end(kFindingCodes)) << finding.code;
  SymptomCode code;
  code.name_ = *known;
  return code;
}

std::string ShiftedFromOnText(const std::string& first, std::ptrdiff_t step) {
  const std::string distance = std::to_string(std::abs(step)) + (std::abs(step) == 1 ? " row" : " rows");
  return "from " + first + " on, each image belongs to the pose " + distance +
         (step > 0 ? " further down: the file has poses without an image before it"
                   : " further up: there are images without a pose before it");
}

bool IsOfSingleCaptures(const Symptom& symptom) {
  constexpr std::string_view kOfCaptures[] = {"swapped",       "wrong_pose",          "contradicts",
                                              "same_picture",  "same_pose",           "unpaired",
                                              "joint_pairing", "target_often_missed", "repeated_image"};
  if (symptom.code.name() == "pairing" && !symptom.captures.empty()) return true;
  return std::find(std::begin(kOfCaptures), std::end(kOfCaptures), symptom.code.name()) != std::end(kOfCaptures);
}

}  // namespace heba
