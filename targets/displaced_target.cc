#include "heba/displaced_target.h"

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace heba {
namespace {

class DisplacedTarget final : public Target {
 public:
  DisplacedTarget(std::shared_ptr<const Target> designed, const PointOffsets& offsets)
      : designed_(std::move(designed)), points_(designed_->points()) {
    if (designed_->scale_sigma()) set_scale_sigma(*designed_->scale_sigma());
    for (TargetPoint& point : points_) {
      const auto offset = offsets.find(point.id);
      if (offset != offsets.end()) point.in_target += offset->second;
    }
  }

  std::string_view type() const override { return designed_->type(); }
  const std::vector<TargetPoint>& points() const override { return points_; }
  Detection Detect(const cv::Mat& grey) const override { return designed_->Detect(grey); }
  const Drawing& Draw() const override { return designed_->Draw(); }
  std::vector<std::string> Codes() const override { return designed_->Codes(); }
  std::vector<Rigid3d> Symmetries() const override { return designed_->Symmetries(); }
  TargetSettings WithoutSymmetry() const override { return designed_->WithoutSymmetry(); }
  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& grey) const override {
    return designed_->LikelyMisconfigurations(grey);
  }
  TargetSettings UnitLengths() const override { return designed_->UnitLengths(); }

 private:
  std::shared_ptr<const Target> designed_;
  std::vector<TargetPoint> points_;
};

}  // namespace

std::shared_ptr<const Target> Displaced(std::shared_ptr<const Target> designed, const PointOffsets& offsets) {
  if (offsets.empty()) return designed;
  return std::make_shared<const DisplacedTarget>(std::move(designed), offsets);
}

}  // namespace heba
