// What tables of several runs say of each.
#pragma once

#include <optional>
#include <string>

#include "heba/evaluation/evaluation.h"

namespace heba {

// The refinement that the other estimates lead up to, with its covariance; null if there is none.
const Estimate* FindRefined(const RunResult& result);
// The closed form with the lowest hold-out error; null if none has one.
const Estimate* FindBestClosedForm(const RunResult& result);

// One sigma of the hand-eye pose as a whole (root of the sum over the axes); nothing without a covariance.
std::optional<double> TranslationSigmaMm(const Estimate& estimate);
std::optional<double> RotationSigmaDeg(const Estimate& estimate);

int NumUsedCaptures(const RunResult& result);

// As RFC 4180 has it.
std::string CsvField(const std::string& text);

}  // namespace heba
