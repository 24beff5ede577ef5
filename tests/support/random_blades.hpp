// SPDX-License-Identifier: MIT
//
// Blades that a fuzz test throws at a body: of any size, in and out of general position.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>

#include "core/body/lattice.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"

namespace kerf::test {

/// Draws from a generator without the library's distributions, so that every machine draws alike.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  /// An integer in [0, n).
  int roll(int n) { return static_cast<int>(random_() % static_cast<std::uint64_t>(n)); }
  /// A number in [lo, hi).
  double between(double lo, double hi) {
    return lo + (hi - lo) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  Vec3d direction() {
    for (;;) {
      const Vec3d v{between(-1, 1), between(-1, 1), between(-1, 1)};
      const double length = norm(v);
      if (length > 0.1 && length < 1) return (1 / length) * v;
    }
  }

 private:
  std::mt19937_64 random_;
};

/// A blade near the body of `lattice`, in its reference state.
class RandomBlades {
 public:
  RandomBlades(const Lattice& lattice, Dice& dice) : lattice_(lattice), dice_(dice) {}

  TriangleMesh next() {
    constexpr int kKinds = 12;
    const int kind = dice_.roll(kKinds);
    if (kind == kKinds - 1 && !last_.triangles.empty()) return last_;  // once more
    return last_ = draw(kind);
  }

 private:
  double body() const {
    return lattice_.spacing * std::max({lattice_.size[0], lattice_.size[1], lattice_.size[2]});
  }
  /// Anywhere in the lattice or a little beside it.
  Vec3d place() {
    Vec3d p = lattice_.origin;
    for (int d = 0; d < 3; ++d)
      p[d] += lattice_.spacing * dice_.between(-1, lattice_.size[static_cast<std::size_t>(d)] + 1);
    return p;
  }
  /// A grid point, or a centre of a cell, a face or an edge: a multiple of half a cell.
  Vec3d special_place() {
    Vec3d p;
    for (int d = 0; d < 3; ++d) {
      const int q = dice_.roll(2 * lattice_.size[static_cast<std::size_t>(d)] + 1);
      p[d] = lattice_.origin[d] + 0.5 * q * lattice_.spacing;
    }
    return p;
  }
  Vec3d special_direction() {
    for (;;) {
      const Vec3d v{1.0 * dice_.roll(5) - 2, 1.0 * dice_.roll(5) - 2, 1.0 * dice_.roll(5) - 2};
      if (norm(v) > 0) return v;
    }
  }
  TriangleMesh triangle_around(const Vec3d& p, double size) {
    TriangleMesh mesh;
    for (int i = 0; i < 3; ++i) mesh.points.push_back(p + size * dice_.direction());
    mesh.triangles = {{0, 1, 2}};
    return mesh;
  }
  TriangleMesh soup(bool special) {
    TriangleMesh mesh;
    for (int i = 0; i < 8; ++i) mesh.points.push_back(special ? special_place() : place());
    for (int i = 0; i < 10; ++i)
      mesh.triangles.push_back({dice_.roll(8), dice_.roll(8), dice_.roll(8)});
    return mesh;
  }

  TriangleMesh draw(int kind) {
    // Drawn one after another here: the order of arguments is the compiler's choice.
    const double h = lattice_.spacing;
    const Vec3d here = place(), there = place(), special = special_place();
    const Vec3d normal = dice_.direction();
    switch (kind) {
      case 0:  // a large plane
        return plane_blade(here, normal, 2 * body());
      case 1:  // a triangle of about a cell
        return triangle_around(here, h * dice_.between(0.5, 4));
      case 2:  // a tiny one
        return triangle_around(special, h * std::pow(10, dice_.between(-13, -1)));
      case 3:  // a huge one
        return plane_blade(here, normal, body() * std::pow(10, dice_.between(1, 5)));
      case 4: {  // through grid points and centres, slanted
        const Vec3d slanted = special_direction();
        return plane_blade(special, slanted, h * (2 + dice_.roll(12)));
      }
      case 5: {  // in the plane of cell faces or of centres
        Vec3d along;
        along[dice_.roll(3)] = 1;
        return plane_blade(special, along, h * (1 + dice_.roll(10)));
      }
      case 6:  // without area
        return {{here, special, 0.5 * here + 0.5 * special}, {{0, 1, 2}, {0, 1, 1}, {2, 2, 2}}};
      case 7:  // triangles that cross each other and repeat points
        return soup(false);
      case 8:
        return soup(true);
      case 9:  // a needle
        return {{here, there, here + (1e-6 * h) * normal}, {{0, 1, 2}}};
      default:  // curved, or closed
        return dice_.roll(2) == 0
                   ? sweep(arc_lines(here, body() * dice_.between(0.2, 0.6), body(), 7))
                   : stamp_blade(here.x, here.y, body() * dice_.between(0.1, 0.4), here.z, there.z,
                                 9);
    }
  }

  Lattice lattice_;
  Dice& dice_;
  TriangleMesh last_;
};

/// KERF_FUZZ, or `few`: enough for every day.
inline int blade_count(int few = 400) {
  const char* count = std::getenv("KERF_FUZZ");
  return count == nullptr ? few : std::atoi(count);
}

inline Voxels random_body(Dice& dice) {
  switch (dice.roll(5)) {
    case 0:
      return box_body({8, 8, 8});
    case 1:
      return box_body({1 + dice.roll(4), 5 + dice.roll(9), 1 + dice.roll(12)});
    case 2:
      return ball_body(12);
    case 3:
      return make_voxels(lattice_of({12, 12, 12}), [](const Vec3i& c) { return c[1] < 5 ? 1 : 2; });
    default:
      return two_limb_body({12, 6, 14});
  }
}

}  // namespace kerf::test
