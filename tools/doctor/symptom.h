// What the doctor finds: one sentence of what is wrong with its evidence, one of what to change.
#pragma once

#include <string>

namespace heba {

enum class Severity { kRemark, kWrong };

struct Symptom {
  Severity severity = Severity::kRemark;
  // Short, and the same in every version: what programs ask for.
  std::string code;
  std::string what;  // With the evidence.
  std::string cure;  // What to change; may be empty.
};

}  // namespace heba
