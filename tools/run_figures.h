// What tables of several runs say of each.
#pragma once

#include <optional>
#include <string>

#include "heba/evaluation/evaluation.h"

namespace heba {

// One sigma of the hand-eye pose as a whole (root of the sum over the axes); nothing without a covariance.
std::optional<double> TranslationSigmaMm(const Estimate& estimate);
std::optional<double> RotationSigmaDeg(const Estimate& estimate);

int NumUsedCaptures(const RunResult& result);

// "[x, y, z] mm, quaternion xyzw [...]", w not negative.
std::string PoseText(const Rigid3d& pose);
// Three digits, or "-".
std::string FigureText(const std::optional<double>& value);

// Why --fail-on fails a run, as an error line says it.
std::string VerdictFailure(const Verdict& verdict);

// As RFC 4180 has it.
std::string CsvField(const std::string& text);

}  // namespace heba
