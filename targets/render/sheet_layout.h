// Measures of a sheet that its layout, its painter and its files share, in mm.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

#include <Eigen/Core>

#include "heba/base/text.h"

namespace heba {

inline constexpr size_t kMostSheetPages = 400;

inline constexpr double kSheetBandMm = 10;      // Width of the vertical ruler on the left, with the mark of y.
inline constexpr double kSheetMarkRoomMm = 5;   // Room for the mark of x beside the drawing.
inline constexpr double kSheetPlainRoomMm = 2;  // Room on the opposite side.
inline constexpr double kSheetMarkMm = 2.5;     // Distance of the marks from the drawing.
// The strip has the ruler's ticks at the top, its numbers below them, then the lines of the small print; the QR code is
// on the right.
inline constexpr double kSheetRulerTopMm = 2;
inline constexpr double kSheetNumbersMm = 7;   // Baseline of the ruler's numbers.
inline constexpr double kSheetPrintMm = 11;    // Baseline of the first line of the small print.
inline constexpr double kSheetLineMm = 2.9;    // Distance of the lines.
inline constexpr double kSheetLetterMm = 2.2;  // Height of the letters.
inline constexpr double kSheetGapMm = 3;       // Between the small print and the code.
inline constexpr double kSheetCodeModuleMm = 0.4;
// A page of several has its marks in a frame inside of the margin: the marks of its neighbours' edges beside the part
// of the sheet, then its label. It overlaps with the next one by this much or more.
inline constexpr double kSheetFrameMm = 5;
inline constexpr double kSheetEdgeMarkMm = 2;
inline constexpr double kSheetLabelMm = 4.4;  // Baseline of the label.
inline constexpr double kSheetOverlapMm = 10;

// Return a length, and a width and a height, as texts.
inline std::string ShownMm(double mm) { return RoundTrip(std::round(mm * 100) / 100); }
inline std::string ShownSize(const Eigen::Vector2d& size_mm) {
  return ShownMm(size_mm.x()) + " x " + ShownMm(size_mm.y()) + " mm";
}

}  // namespace heba
