// A finding about a result, readable for people and for programs.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace heba {

enum class Grade { kGood, kDoubtful, kBad };
std::string_view GradeName(Grade grade);  // "good", "doubtful", "bad"

struct Finding {
  Grade grade = Grade::kGood;
  std::string code;    // Short code, stable over versions, by which programs identify the finding.
  std::string text;    // The observation, with its figures.
  std::string action;  // The remedy; empty if nothing needs to be done.
  std::vector<std::pair<std::string, double>> numbers = {};  // The figures of the text, named with their units.
  // True if the finding names a cause rather than a symptom. Its symptoms are then not listed separately.
  bool is_cause = false;
};

struct Verdict {
  Grade grade = Grade::kGood;     // The worst grade of the findings.
  std::vector<Finding> findings;  // The worst first; among equal grades, causes first.
};

}  // namespace heba
