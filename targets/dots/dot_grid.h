// Common parts of targets with dots in rows and columns.
#pragma once

#include "heba/config/yaml_reader.h"
#include "targets/dots/ellipse_finder.h"

namespace heba {

struct DotGrid {
  int rows = 0;
  int columns = 0;
  double spacing_m = 0;
  DotPolarity polarity = DotPolarity::kDarkOnLight;

  // The albedos of the sheet and of the ink on it.
  double Ground() const { return polarity == DotPolarity::kLightOnDark ? 0 : 1; }
  double Ink() const { return 1 - Ground(); }
};

// Reads the keys rows, columns, spacing and light_on_dark.
DotGrid ReadDotGrid(MapReader& reader);

}  // namespace heba
