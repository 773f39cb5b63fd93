// Quantities as users write them: a number and its unit, "40 mm".
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace heba {

// A kind of quantity, with the units that it may be written in.
enum class Quantity { kLength, kAngle, kPixels, kGreyLevels };

// "m", "rad", "px", "grey": the unit in which heba computes.
std::string_view BaseUnit(Quantity quantity);
// "a length such as '40 mm'": for messages.
std::string_view Example(Quantity quantity);

// The greatest absolute value that a file may state: 10 km, 100 turns, a million pixels or grey levels. More is a slip,
// and would not fit into what is computed with it.
double MaxQuantity(Quantity quantity);

struct ParsedQuantity {
  double value = 0;   // In BaseUnit(quantity).
  std::string fault;  // Empty if `text` is a quantity of this kind; else what is wrong with it, as a clause.
};
// Reads "40 mm", "0.1rad", "-3 deg". A number without a unit, an unknown unit and a value that is not finite are
// faults.
ParsedQuantity ParseQuantity(std::string_view text, Quantity quantity);

constexpr double kPi = 3.14159265358979323846;
constexpr double DegToRad(double angle_deg) { return angle_deg * (kPi / 180.0); }
constexpr double RadToDeg(double angle_rad) { return angle_rad * (180.0 / kPi); }

}  // namespace heba
