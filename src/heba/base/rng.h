// Random numbers that are the same on every machine and with every compiler. They depend on a seed only, never on a
// clock. Compilers evaluate the arguments of a call in different orders, so a call's arguments hold at most one draw;
// those in braces are evaluated from left to right.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include <Eigen/Core>

namespace heba {

class Rng {
 public:
  explicit Rng(uint64_t seed) : engine_(seed) {}
  // Creates the generator for part `index` of the work. Every part has its own stream, so that the parts can run in any
  // order and on any thread.
  Rng(uint64_t seed, uint64_t index) : engine_(Mix(Mix(seed) + index)) {}

  // Returns a uniform number in [0, 1).
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  // Returns a uniform integer in [0, count).
  int Index(int count) { return static_cast<int>(Uniform() * count); }
  // Returns a normal deviate with mean 0 and standard deviation 1 (Box and Muller 1958).
  double Normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    const double angle = 6.283185307179586 * Uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }
  Eigen::Vector3d NormalVector3() {
    const double x = Normal();
    const double y = Normal();
    const double z = Normal();
    return {x, y, z};
  }
  // Returns a vector that is uniform on the unit sphere.
  Eigen::Vector3d Direction3() {
    Eigen::Vector3d direction;
    do {
      direction = NormalVector3();
    } while (direction.norm() < 1e-3);
    return direction.normalized();
  }

 private:
  // The finaliser of splitmix64, which gives unrelated streams for neighbouring seeds.
  static uint64_t Mix(uint64_t z) {
    z += 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::mt19937_64 engine_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace heba
