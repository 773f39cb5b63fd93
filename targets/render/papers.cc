#include "targets/render/papers.h"

namespace heba {

const std::vector<Paper>& Papers() {
  static const std::vector<Paper> papers = {
#define HEBA_PAPER(name, series, width_mm, height_mm) {#name, #series, width_mm, height_mm},
#include "targets/render/papers.def"
#undef HEBA_PAPER
  };
  return papers;
}

}  // namespace heba
