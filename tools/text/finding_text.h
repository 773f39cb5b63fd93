// The words of findings for users of the program, which name the keys of configs: one place for the reports,
// result.json, the terminal and the doctor.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"
#include "heba/evaluation/run_result.h"
#include "tools/text/config_setting.h"
#include "tools/text/failure_text.h"

namespace heba {

struct FindingText {
  std::string text;    // The observation, with its figures and with those of the parts that it mentions.
  std::string action;  // The remedy; empty if nothing needs to be done, which is the case if the grade is good.
  std::vector<ConfigSetting> settings =
      {};  // The settings that the remedy changes, if the finding was not described before.
};

// Returns the words of a finding: its own text and action if it has a text (the findings of a file and of the doctor
// have one), otherwise those of its code. Those of an unknown code are the code and the numbers. The text of a cause
// continues with its consequences, the parts, unless it has them already. A number that the code needs and the finding
// does not have is shown as "nan".
FindingText FindingWords(const Finding& finding);

// These functions return findings whose text and action, and those of their parts, are their words. A finding that was
// described before does not change.
Finding Described(Finding finding, ConfigKeys keys = ConfigKeys::kNamed);
std::vector<Finding> Described(std::vector<Finding> findings, ConfigKeys keys = ConfigKeys::kNamed);

// Returns a result with the texts of the findings of its verdict, and of the failures in it.
RunResult Described(RunResult result, ConfigKeys keys = ConfigKeys::kNamed);

}  // namespace heba
