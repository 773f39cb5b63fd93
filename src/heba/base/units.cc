#include "heba/base/units.h"

#include <charconv>
#include <cmath>
#include <vector>

#include "heba/base/text.h"

namespace heba {
namespace {

struct Unit {
  Quantity quantity;
  std::string_view name;
  double factor;  // Factor that converts to the base unit.
};
constexpr Unit kUnits[] = {
    {Quantity::kLength, "m", 1.0},
    {Quantity::kLength, "cm", 1e-2},
    {Quantity::kLength, "mm", 1e-3},
    {Quantity::kLength, "um", 1e-6},
    {Quantity::kLength, "in", 25.4e-3},
    {Quantity::kAngle, "rad", 1.0},
    {Quantity::kAngle, "mrad", 1e-3},
    {Quantity::kAngle, "deg", kPi / 180.0},
    {Quantity::kPixels, "px", 1.0},
    {Quantity::kGreyLevels, "grey", 1.0},
    {Quantity::kMass, "kg", 1.0},
    {Quantity::kMass, "g", 1e-3},
    {Quantity::kCompliance, "rad/(N m)", 1.0},
    {Quantity::kCompliance, "deg/(N m)", kPi / 180.0},
    {Quantity::kRatio, "", 1.0},
    {Quantity::kRatio, "%", 1e-2},
};

}  // namespace

std::string_view BaseUnit(Quantity quantity) {
  for (const Unit& unit : kUnits) {
    if (unit.quantity == quantity) return unit.name;
  }
  return "";
}

std::string_view Example(Quantity quantity) {
  switch (quantity) {
    case Quantity::kLength:
      return "a length such as '40 mm'";
    case Quantity::kAngle:
      return "an angle such as '5 deg'";
    case Quantity::kPixels:
      return "pixels such as '0.3 px'";
    case Quantity::kGreyLevels:
      return "grey levels (of 255) such as '2 grey'";
    case Quantity::kMass:
      return "a mass such as '1.2 kg'";
    case Quantity::kCompliance:
      return "a compliance such as '2e-5 rad/(N m)'";
    case Quantity::kRatio:
      return "a ratio such as '0.1 %' or 0.001";
  }
  return "";
}

double MaxQuantity(Quantity quantity) {
  switch (quantity) {
    case Quantity::kLength:
      return 1e4;
    case Quantity::kAngle:
      return 200 * kPi;
    case Quantity::kPixels:
    case Quantity::kGreyLevels:
      return 1e6;
    case Quantity::kMass:
      return 1e4;
    case Quantity::kCompliance:
    case Quantity::kRatio:
      return 1;
  }
  return 0;
}

ParsedQuantity ParseQuantity(std::string_view text, Quantity quantity) {
  const std::string expected = std::string(Example(quantity));
  std::string trimmed = Trim(text);
  std::string_view rest = trimmed;
  if (rest.starts_with('+') && !rest.starts_with("+-")) rest.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), number);
  if (error != std::errc()) return {0, Quoted(trimmed) + " is not " + expected};
  if (!std::isfinite(number)) return {0, Quoted(trimmed) + " is not finite"};
  const std::string unit_name = Trim(rest.substr(static_cast<size_t>(end - rest.data())));
  if (unit_name.empty() && !BaseUnit(quantity).empty()) return {0, Quoted(trimmed) + " has no unit; write " + expected};
  std::vector<std::string> known;
  for (const Unit& unit : kUnits) {
    if (unit.quantity != quantity) continue;
    if (unit.name == unit_name) {
      const double value = number * unit.factor;
      const double most = MaxQuantity(quantity);
      if (std::abs(value) > most) {
        return {0, Quoted(trimmed) + " is out of range; at most " +
                       Trim(Significant(most / unit.factor, 6) + " " + std::string(unit.name)) + " is possible"};
      }
      return {value, ""};
    }
    if (!unit.name.empty()) known.emplace_back(unit.name);
  }
  return {0, Quoted(trimmed) + " has the unit " + Quoted(unit_name) + "; one of " + Join(known, ", ") + " is needed" +
                 DidYouMean(unit_name, known)};
}

}  // namespace heba
