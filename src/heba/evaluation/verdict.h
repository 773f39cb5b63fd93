// What a result is worth, in words.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "heba/evaluation/evaluation.h"

namespace heba {

enum class Grade { kGood, kDoubtful, kBad };
std::string_view GradeName(Grade grade);  // "good", "doubtful", "bad"

// One thing that was looked at: what was found, with its number, and what would better it.
struct Finding {
  Grade grade = Grade::kGood;
  std::string what;
  std::string cure;  // Empty if it is good.
};

struct Verdict {
  Grade grade = Grade::kGood;     // The worst of the findings'.
  std::vector<Finding> findings;  // The worst first.
};

// The refined estimate as a person who has to grasp with it would judge it: its own uncertainty, how far the target was
// from where it was predicted on captures that it has not seen, whether its model explains these, how many captures it
// rests on and how many it had to leave out, whether it hangs on one of them, whether closed forms do better, and the
// remarks that came with it.
Verdict JudgeRun(const RunResult& result);

}  // namespace heba
