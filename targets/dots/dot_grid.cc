#include "targets/dots/dot_grid.h"
#include "heba/config/yaml_reader.h"

namespace heba {

DotGrid ReadDotGrid(MapReader& reader) {
  DotGrid grid;
  grid.rows = reader.Int("rows", {2, 200});
  grid.columns = reader.Int("columns", {2, 200});
  grid.spacing_m = reader.PositiveLength("spacing");
  const bool light_on_dark = reader.Bool("light_on_dark", false);
  grid.polarity = light_on_dark ? DotPolarity::kLightOnDark : DotPolarity::kDarkOnLight;
  return grid;
}

}  // namespace heba
