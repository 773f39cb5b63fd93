// A diagnosis as text for people and as JSON for programs.
#pragma once

#include <string>

#include "tools/doctor/doctor.h"

namespace heba {

// Lists the symptoms; of many that are alike, only the first few.
std::string DiagnosisText(const std::string& name, const Diagnosis& diagnosis);

// Returns one JSON document with all symptoms, the worst first: {"schema": "heba/diagnosis/1", "heba", "name",
// "captures", "seen", "wrong", "remarks", "symptoms": [{"grade": "wrong" or "remark", "code", "text", "action",
// "settings": [{"key", "value"}]}]}. `seen` is the number of captures that determine a pose of the target. `settings`
// make the changes of `action` (ConfigSetting); empty if one of these is another change, or a choice between several.
std::string DiagnosisToJson(const std::string& name, const Diagnosis& diagnosis);

}  // namespace heba
