// A target for tests that use only its drawing and points, which the test supplies. It detects nothing.
#pragma once

#include <vector>

#include "heba/target.h"

namespace heba {

class FakeTarget final : public Target {
 public:
  Drawing drawing;
  std::vector<TargetPoint> target_points;

  std::string_view type() const override { return "fake"; }
  const std::vector<TargetPoint>& points() const override { return target_points; }
  Detection Detect(const cv::Mat& /*grey*/) const override { return {}; }
  const Drawing& Draw() const override { return drawing; }
};

}  // namespace heba
