// The size of an image.
#pragma once

namespace heba {

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const ImageSize& other) const = default;
};

}  // namespace heba
