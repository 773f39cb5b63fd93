// One thing that was found about a result, for people and for programs.
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
  std::string code;    // Short, and the same in every version: what programs ask for.
  std::string text;    // The observation, with its figures.
  std::string action;  // The remedy; empty if nothing needs to be done.
  std::vector<std::pair<std::string, double>> numbers = {};  // The figures of the text, named with their units.
  // Whether it says what is wrong, not how that shows: then the findings that show it need no mention of their own.
  bool is_cause = false;
};

struct Verdict {
  Grade grade = Grade::kGood;     // The worst of the findings'.
  std::vector<Finding> findings;  // The worst first; of these, causes first.
};

}  // namespace heba
