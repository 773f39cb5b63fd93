#include "heba/data/pose_stream.h"

#include <algorithm>
#include <cstddef>

#include <glog/logging.h>

namespace heba {
namespace {

// The cubic between two neighbouring poses of a stream, as tangents at the earlier one.
struct Piece {
  size_t first = 0;
  double length_s = 0;
  Tangent6 end;          // The later pose; the earlier one is zero.
  Tangent6 first_slope;  // 1/s, likewise at the end.
  Tangent6 end_slope;
};

// Returns the slope at the middle one of three places of a parabola.
Tangent6 SlopeOfParabola(double before_s, const Tangent6& before, double after_s, const Tangent6& after) {
  return (before * (after_s / before_s) + after * (before_s / after_s)) / (before_s + after_s);
}

Piece PieceAt(const PoseStream& stream, double time_s) {
  const std::vector<double>& times = stream.times_s;
  const auto after = std::upper_bound(times.begin(), times.end(), time_s);
  Piece piece;
  piece.first = static_cast<size_t>(
      std::clamp<std::ptrdiff_t>(after - times.begin() - 1, 0, static_cast<std::ptrdiff_t>(times.size()) - 2));
  const size_t k = piece.first;
  const auto tangent_of = [&](size_t i) -> Tangent6 {
    return LocalCoordinates(stream.base_from_gripper[k], stream.base_from_gripper[i]);
  };
  piece.length_s = times[k + 1] - times[k];
  piece.end = tangent_of(k + 1);
  piece.first_slope = piece.end_slope = piece.end / piece.length_s;
  if (k > 0) {
    piece.first_slope = SlopeOfParabola(times[k] - times[k - 1], -tangent_of(k - 1), piece.length_s, piece.end);
  }
  if (k + 2 < times.size()) {
    piece.end_slope =
        SlopeOfParabola(piece.length_s, piece.end, times[k + 2] - times[k + 1], tangent_of(k + 2) - piece.end);
  }
  return piece;
}

}  // namespace

bool Covers(const PoseStream& stream, double time_s) {
  return stream.times_s.front() <= time_s && time_s <= stream.times_s.back();
}

Rigid3d PoseAt(const PoseStream& stream, double time_s) {
  CHECK_GE(stream.times_s.size(), 2U);
  const double within_s = std::clamp(time_s, stream.times_s.front(), stream.times_s.back());
  const Piece piece = PieceAt(stream, within_s);
  const double u = (within_s - stream.times_s[piece.first]) / piece.length_s;
  const Tangent6 tangent = u * u * (3 - 2 * u) * piece.end +
                           u * (1 - u) * piece.length_s * ((1 - u) * piece.first_slope - u * piece.end_slope);
  return Retract(stream.base_from_gripper[piece.first], tangent);
}

Tangent6 VelocityAt(const PoseStream& stream, double time_s) {
  if (!Covers(stream, time_s)) return Tangent6::Zero();
  constexpr double kStepS = 1e-4;
  const Rigid3d pose = PoseAt(stream, time_s);
  const double before_s = std::max(time_s - kStepS, stream.times_s.front());
  const double after_s = std::min(time_s + kStepS, stream.times_s.back());
  return (LocalCoordinates(pose, PoseAt(stream, after_s)) - LocalCoordinates(pose, PoseAt(stream, before_s))) /
         (after_s - before_s);
}

}  // namespace heba
