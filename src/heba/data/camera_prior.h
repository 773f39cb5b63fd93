// Prior knowledge of a camera, before the captures are used.
#pragma once

#include <vector>

namespace heba {

// Prior knowledge of a camera: its parameters and one sigma for each, infinite if nothing is known about a parameter.
struct CameraPrior {
  std::vector<double> params;
  std::vector<double> sigmas;
};

}  // namespace heba
