// What a result is worth, in words.
#pragma once

#include "heba/evaluation/evaluation.h"

namespace heba {

// The refined estimate as a person who has to grasp with it would judge it: its own uncertainty, how far the target was
// from where it was predicted on captures that it has not seen, whether its model explains these, how many captures it
// rests on and how many it had to leave out, whether it hangs on one of them, whether closed forms do better, and
// RunResult::observations. Where the result says what it is required to reach (RunResult::requirements), that takes the
// place of the built-in limits on uncertainty and hold-out errors. One cause gives one finding: what follows from it is
// said with it.
Verdict JudgeRun(const RunResult& result);

}  // namespace heba
