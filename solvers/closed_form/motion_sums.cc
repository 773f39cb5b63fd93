#include "solvers/closed_form/motion_sums.h"

#include <algorithm>
#include <cmath>

#include "heba/base/units.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/simd.h"

namespace heba {
namespace {

// Poses as a structure of arrays, padded so that a full vector can be loaded from any index.
struct PoseArrays {
  std::vector<double> rotation[9];    // Stored column by column.
  std::vector<double> quaternion[4];  // w, x, y, z.
  std::vector<double> translation[3];

  explicit PoseArrays(size_t size) {
    const auto resize = [size](auto& columns) {
      for (auto& column : columns) column.assign(size + kMaxLanes, 0.0);
    };
    resize(rotation);
    resize(quaternion);
    resize(translation);
  }
  void Set(size_t i, const Rigid3d& pose) {
    const Eigen::Matrix3d matrix = pose.RotationMatrix();
    for (int k = 0; k < 9; ++k) rotation[k][i] = matrix.data()[k];
    quaternion[0][i] = pose.rotation.w();
    for (int k = 0; k < 3; ++k) {
      quaternion[k + 1][i] = pose.rotation.vec()[k];
      translation[k][i] = pose.translation[k];
    }
  }
};

// Bounds on the cosine of half the rotation angle.
struct Cosines {
  double most = 1;   // Cosine of half the smallest angle.
  double least = 0;  // Cosine of half the largest angle.
};

// A batch of motions whose columns are still to be multiplied.
struct MotionBatch {
  static constexpr int kCapacity = 128;
  static constexpr int kStride = kCapacity + kMaxLanes;
  int size = 0;
  alignas(64) double linear[MotionSums::kNumLinear + 1][kStride];
  alignas(64) double screws[MotionSums::kNumScrew][kStride];
  alignas(64) double axes[MotionSums::kNumAxes][kStride];
};

template <class V>
struct Motion {
  V rotation[9];
  V w;
  V vec[3];
  V translation[3];
};

// Computes the motions from capture i to the captures from index j on, one per lane.
template <class V>
HEBA_INLINE Motion<V> MotionOf(const PoseArrays& poses, size_t i, size_t j) {
  Motion<V> motion;
  const auto at_i = [i](const std::vector<double>& values) __attribute__((always_inline)) { return values[i]; };
  const auto at_j = [j](const std::vector<double>& values) __attribute__((always_inline)) {
    return LoadLanes<V>(values.data() + j);
  };
  // R_j R_i^T.
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      motion.rotation[3 * column + row] = at_j(poses.rotation[row]) * at_i(poses.rotation[column]) +
                                          at_j(poses.rotation[3 + row]) * at_i(poses.rotation[3 + column]) +
                                          at_j(poses.rotation[6 + row]) * at_i(poses.rotation[6 + column]);
    }
  }
  const double wi = at_i(poses.quaternion[0]);
  const double xi = at_i(poses.quaternion[1]);
  const double yi = at_i(poses.quaternion[2]);
  const double zi = at_i(poses.quaternion[3]);
  const V wj = at_j(poses.quaternion[0]);
  const V xj = at_j(poses.quaternion[1]);
  const V yj = at_j(poses.quaternion[2]);
  const V zj = at_j(poses.quaternion[3]);
  const V w = wj * wi + xj * xi + yj * yi + zj * zi;
  const V sign = w < 0.0 ? AllLanes<V>(-1) : AllLanes<V>(1);
  motion.w = sign * w;
  motion.vec[0] = sign * (xj * wi - wj * xi + zj * yi - yj * zi);
  motion.vec[1] = sign * (yj * wi - wj * yi + xj * zi - zj * xi);
  motion.vec[2] = sign * (zj * wi - wj * zi + yj * xi - xj * yi);
  for (int row = 0; row < 3; ++row) {
    motion.translation[row] = at_j(poses.translation[row]) - (motion.rotation[row] * at_i(poses.translation[0]) +
                                                              motion.rotation[3 + row] * at_i(poses.translation[1]) +
                                                              motion.rotation[6 + row] * at_i(poses.translation[2]));
  }
  return motion;
}

// Appends the motions to `batch`; lanes that are not used are set to 0.
template <class V, class Mask>
HEBA_INLINE void StoreMotion(const Motion<V>& motion, const Mask& is_used, const int (&linear)[2],
                             const int (&screw)[2], const int (&axes)[2], MotionBatch* batch) {
  const V none = AllLanes<V>(0);
  const int at = batch->size;
  const auto store = [&](const V& value, double* row) __attribute__((always_inline)) {
    StoreLanes<V>(is_used ? value : none, row + at);
  };
  for (int k = 0; k < 9; ++k) store(motion.rotation[k], batch->linear[linear[0] + k]);
  for (int k = 0; k < 3; ++k) store(motion.translation[k], batch->linear[linear[1] + k]);
  const V& w = motion.w;
  const V* const v = motion.vec;
  const V* const t = motion.translation;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    const int last = (k + 2) % 3;
    store(v[k], batch->screws[screw[0] + k]);
    store(0.5 * (w * t[k] + t[next] * v[last] - t[last] * v[next]), batch->screws[screw[1] + k]);
  }
  const V squares = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  const V sine = EachLane(squares, w, [](double s2, double) { return std::sqrt(s2); });
  const V angle = EachLane(sine, w, [](double s, double c) { return 2 * std::atan2(s, c); });
  for (int k = 0; k < 3; ++k) {
    const V axis = v[k] / sine;
    store(axis, batch->axes[axes[1] + k]);
    store(angle * axis, batch->axes[axes[0] + k]);
  }
}

// Appends the motions from capture i to `count` captures from index j on.
template <int kLanes>
HEBA_INLINE void Append(const PoseArrays& mounts, const PoseArrays& cameras, const Cosines& cosines, size_t i, size_t j,
                        int count, MotionBatch* batch) {
  using V = Lanes<kLanes>;
  const int end = batch->size + count;
  for (; batch->size < end; batch->size += kLanes, j += kLanes) {
    const Motion<V> a = MotionOf<V>(mounts, i, j);
    const Motion<V> b = MotionOf<V>(cameras, i, j);
    const auto is_used =
        (a.w <= cosines.most) & (b.w <= cosines.most) & (a.w >= cosines.least) & (b.w >= cosines.least);
    StoreLanes<V>(is_used ? AllLanes<V>(1) : AllLanes<V>(0), batch->linear[MotionSums::kOne] + batch->size);
    StoreMotion<V>(a, is_used, {MotionSums::kRotationA, MotionSums::kTranslationA},
                   {MotionSums::kRealA, MotionSums::kDualA}, {MotionSums::kVectorA, MotionSums::kAxisA}, batch);
    StoreMotion<V>(b, is_used, {MotionSums::kRotationB, MotionSums::kTranslationB},
                   {MotionSums::kRealB, MotionSums::kDualB}, {MotionSums::kVectorB, MotionSums::kAxisB}, batch);
  }
  batch->size = end;
}
HEBA_TARGET_AVX2 void AppendAvx2(const PoseArrays& mounts, const PoseArrays& cameras, const Cosines& cosines, size_t i,
                                 size_t j, int count, MotionBatch* batch) {
  Append<kLanesOf<Simd::kAvx2>>(mounts, cameras, cosines, i, j, count, batch);
}
HEBA_TARGET_AVX512 void AppendAvx512(const PoseArrays& mounts, const PoseArrays& cameras, const Cosines& cosines,
                                     size_t i, size_t j, int count, MotionBatch* batch) {
  Append<kLanesOf<Simd::kAvx512>>(mounts, cameras, cosines, i, j, count, batch);
}
void AppendBaseline(const PoseArrays& mounts, const PoseArrays& cameras, const Cosines& cosines, size_t i, size_t j,
                    int count, MotionBatch* batch) {
  Append<kLanesOf<Simd::kBaseline>>(mounts, cameras, cosines, i, j, count, batch);
}

// Returns the smallest rotation that is used, rad: 5 deg, or a quarter of the largest rotation between two captures
// if that is less.
double LeastAngleRad(const std::vector<PosePair>& pairs) {
  const double enough_rad = DegToRad(20.0);
  double largest_rad = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (size_t j = i + 1; j < pairs.size(); ++j) {
      largest_rad = std::max(
          largest_rad, AngleRad(pairs[i].camera_mount_from_target_mount, pairs[j].camera_mount_from_target_mount));
      if (largest_rad >= enough_rad) return 0.25 * enough_rad;
    }
  }
  return 0.25 * largest_rad;
}

}  // namespace

MotionSums SumMotions(const std::vector<PosePair>& pairs) {
  const size_t n = pairs.size();
  PoseArrays mounts(n);
  PoseArrays cameras(n);
  for (size_t i = 0; i < n; ++i) {
    mounts.Set(i, pairs[i].camera_mount_from_target_mount);
    cameras.Set(i, pairs[i].camera_from_target);
  }
  const Cosines cosines = {std::cos(0.5 * LeastAngleRad(pairs)), std::cos(0.5 * DegToRad(170.0))};
  const auto append = SelectForIsa(ActiveSimd(), &AppendBaseline, &AppendAvx2, &AppendAvx512);
  MotionBatch batch;
  GramMatrix linear(MotionSums::kNumLinear, MotionBatch::kStride);
  GramMatrix screws(MotionSums::kNumScrew, MotionBatch::kStride);
  GramMatrix axes(MotionSums::kNumAxes, MotionBatch::kStride);
  const auto multiply = [&] {
    const int padded = PaddedToLanes(batch.size);
    const auto pad = [&](auto& columns) {
      for (auto& column : columns) std::fill(column + batch.size, column + padded, 0.0);
    };
    pad(batch.linear);
    pad(batch.screws);
    pad(batch.axes);
    linear.Add(batch.linear[0], padded);
    screws.Add(batch.screws[0], padded);
    axes.Add(batch.axes[0], padded);
    batch.size = 0;
  };
  // Each capture is combined with later captures in runs of kRun; if there are too many pairs, every stride-th run is
  // used.
  constexpr size_t kMaxPairs = 2'000'000;
  constexpr size_t kRun = 64;
  const size_t num_runs = (n + kRun - 1) / kRun;
  const size_t stride = std::max<size_t>(1, (n * (n - 1) / 2 + kMaxPairs - 1) / kMaxPairs);
  for (size_t i = 0; i + 1 < n; ++i) {
    for (size_t run = 0; run < num_runs; ++run) {
      // The offset by i selects different runs for each capture.
      if ((run + i) % stride != 0) continue;
      for (size_t j = i + 1 + run * kRun; j < std::min(n, i + 1 + (run + 1) * kRun);) {
        if (batch.size == MotionBatch::kCapacity) multiply();
        const size_t room = static_cast<size_t>(MotionBatch::kCapacity - batch.size);
        const size_t count = std::min({n - j, i + 1 + (run + 1) * kRun - j, room});
        append(mounts, cameras, cosines, i, j, static_cast<int>(count), &batch);
        j += count;
      }
    }
  }
  multiply();
  return {linear.Matrix(), screws.Matrix(), axes.Matrix()};
}

}  // namespace heba
