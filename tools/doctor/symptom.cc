#include "tools/doctor/symptom.h"

#include <algorithm>
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

}  // namespace heba
