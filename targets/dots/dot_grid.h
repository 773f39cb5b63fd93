// What boards of dots in rows and columns have in common.
#pragma once

#include "heba/config/yaml_reader.h"
#include "targets/dots/ellipse_finder.h"

namespace heba {

struct DotGrid {
  int rows = 0;
  int columns = 0;
  double spacing_m = 0;
  DotPolarity polarity = DotPolarity::kDarkOnLight;

  // Albedos of the sheet and of what is printed on it.
  double Ground() const { return polarity == DotPolarity::kLightOnDark ? 0 : 1; }
  double Ink() const { return 1 - Ground(); }
};

// From the keys rows, columns, spacing and light_on_dark.
DotGrid ReadDotGrid(MapReader& reader);

}  // namespace heba
