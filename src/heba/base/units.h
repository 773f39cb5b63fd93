// Quantities as users write them: a number with its unit, "40 mm".
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace heba {

// A kind of quantity. The kind determines which units are accepted.
enum class Quantity { kLength, kAngle, kPixels, kGreyLevels, kMass, kCompliance, kRatio };

// Returns the unit in which heba computes: "m", "rad", "px", "grey", "kg", "rad/(N m)"; ratios have none.
std::string_view BaseUnit(Quantity quantity);
// Returns an example for messages: "a length such as '40 mm'".
std::string_view Example(Quantity quantity);

// Returns the greatest absolute value that a file may contain: 10 km, 100 revolutions, a million pixels or grey levels,
// 10 t, 1 rad/(N m), a ratio of 1.
// A larger value is a mistake, and could overflow in the computations that use it.
double MaxQuantity(Quantity quantity);

// The result of ParseQuantity.
struct ParsedQuantity {
  double value = 0;   // Value in BaseUnit(quantity).
  std::string fault;  // Reason why `text` is not a quantity of this kind, as a clause; empty if it is one.
};
// Reads "40 mm", "0.1rad", "-3 deg", "0.1 %" and, only as a ratio, "0.001". A missing unit, an unknown unit and a value
// that is not finite or exceeds MaxQuantity are reported as faults.
ParsedQuantity ParseQuantity(std::string_view text, Quantity quantity);

constexpr double kPi = 3.14159265358979323846;
constexpr double DegToRad(double angle_deg) { return angle_deg * (kPi / 180.0); }
constexpr double RadToDeg(double angle_rad) { return angle_rad * (180.0 / kPi); }

}  // namespace heba
