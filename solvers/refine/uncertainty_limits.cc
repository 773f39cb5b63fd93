#include "solvers/refine/uncertainty_limits.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/uncertainty/information.h"

namespace heba {
namespace {

// The largest sigma at which the unknowns of a group are of use, and the message about a larger one.
struct Limit {
  UnknownGroup group;
  double most;  // In the unit of Covariance; relative to the focal length or to the image's width for the camera.
  double unit;  // The unit of the message.
  const char* unit_name;
  const char* cure;  // That of intrinsics is followed by their key (IntrinsicsKey).
};

constexpr const char* kMoreMotion = "; more captures with larger rotations about different axes are needed";
const Limit kLimits[] = {
    {UnknownGroup::kTranslation, 0.1, 1e-3, " mm", kMoreMotion},
    {UnknownGroup::kRotation, 0.1, DegToRad(1.0), " deg", kMoreMotion},
    {UnknownGroup::kFocal, 0.01, 1, " px",
     ": the captures cannot distinguish focal length from distance; move the target through more depth and tilt, or "
     "hold the focal length with a camera file and "},
    {UnknownGroup::kPrincipalPoint, 0.02, 1, " px",
     ": the captures cannot distinguish it from the camera's orientation; tilt the target more, or hold it with a "
     "camera file and "},
    {UnknownGroup::kScale, 0.01, 0.01, " %",
     ": the captures cannot distinguish it from distance; move the target through more depth, or measure the print "
     "and set refine.target_shape: none"},
    {UnknownGroup::kBend, 5e-3, 1e-3, " mm", "; tilt the target more, or remove the bend from refine.target_shape"},
};

// One sigma of an unknown, and the size that the limit of its group refers to.
struct SigmaOfSize {
  double sigma;
  double size = 1;
};

SigmaOfSize SigmaAt(const Covariance& covariance, Eigen::Index i, const std::vector<Camera>& cameras) {
  const Unknown& unknown = covariance.layout[i];
  const double sigma = std::sqrt(covariance.matrix(i, i));
  const UnknownBlock& block = covariance.layout.BlockAt(i);
  if (block.owner != UnknownOwner::kCamera) return {sigma};
  const std::vector<UnknownBlock> blocks = covariance.layout.BlocksOf(UnknownOwner::kCamera);
  const auto found =
      std::find_if(blocks.begin(), blocks.end(), [&](const UnknownBlock& other) { return other.name == block.name; });
  const Camera& camera = cameras[static_cast<size_t>(found - blocks.begin())];
  if (unknown.group == UnknownGroup::kPrincipalPoint) return {sigma, static_cast<double>(camera.width_px)};
  if (unknown.group != UnknownGroup::kFocal) return {sigma};
  const Eigen::VectorXd by_unknowns = AxialFocalLengthByUnknowns(camera, unknown.index, covariance.layout, block);
  return {std::sqrt(by_unknowns.dot(covariance.matrix * by_unknowns)), AxialFocalLength(camera, unknown.index)};
}

}  // namespace

std::optional<Failure> CheckUncertainty(const Covariance& covariance, const std::vector<Camera>& cameras) {
  for (Eigen::Index i = 0; i < covariance.layout.size(); ++i) {
    const Unknown& unknown = covariance.layout[i];
    const Limit* const limit = std::find_if(std::begin(kLimits), std::end(kLimits),
                                            [&](const Limit& entry) { return entry.group == unknown.group; });
    if (limit == std::end(kLimits)) continue;
    const SigmaOfSize known = SigmaAt(covariance, i, cameras);
    if (known.sigma < limit->most * known.size) continue;
    const UnknownBlock& block = covariance.layout.BlockAt(i);
    return Failure{covariance.layout.PlainName(i) + " is known only to " + Significant(known.sigma / limit->unit, 2) +
                   limit->unit_name + limit->cure + (block.owner == UnknownOwner::kCamera ? IntrinsicsKey(block) : "")};
  }
  return std::nullopt;
}

}  // namespace heba
