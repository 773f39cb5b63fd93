// A symptom that the doctor finds: one sentence on the fault with its evidence, one on its cure.
#pragma once

#include <string>
#include <vector>

#include "tools/text/config_setting.h"

namespace heba {

enum class Severity { kRemark, kWrong };

struct Symptom {
  Severity severity = Severity::kRemark;
  // Short, and the same in every version, because other programs search for it.
  std::string code;
  std::string what;  // Includes the evidence.
  std::string cure;  // The change to make; may be empty.
  // The settings of the config that the cure changes; empty if it is another change, or one of several.
  std::vector<ConfigSetting> settings = {};
};

}  // namespace heba
