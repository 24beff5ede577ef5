// SPDX-License-Identifier: MIT
#include "core/body/mesh_crossings.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/error.hpp"
#include "core/geometry/predicates.hpp"

namespace kerf {
namespace {

constexpr int kFinestBits = 24;  // of a spacing: far below what float distances can tell
constexpr int kRangeBits = 39;   // of all coordinates; one less than the predicates allow

// One triangle on the integer lattice.
struct Facet {
  std::array<Int3, 3> point;
  Vec3d normal;  // unit
  Vec3d slope;   // (b - a) x (c - a) of the integers
  bool drawn;
};

class Rasteriser {
 public:
  Rasteriser(const TriangleMesh& mesh, const Lattice& lattice, int bits, MeshCrossings& out)
      : mesh_(mesh),
        lattice_(lattice),
        bits_(bits),
        half_(std::int64_t{1} << (bits - 1)),
        out_(out) {
    const Quantiser quantise(lattice.origin, std::ldexp(lattice.spacing, -bits));
    points_.reserve(mesh.points.size());
    for (const Vec3d& p : mesh.points) points_.push_back(quantise(p));
  }

  void add(const std::array<std::int32_t, 3>& triangle, bool drawn) {
    Facet facet;
    facet.drawn = drawn;
    for (unsigned i = 0; i < 3; ++i)
      facet.point[i] = points_[static_cast<std::size_t>(triangle[i])];
    const auto& [a, b, c] = facet.point;
    const auto difference = [](const Int3& p, const Int3& q) {
      return Vec3d{static_cast<double>(p[0] - q[0]), static_cast<double>(p[1] - q[1]),
                   static_cast<double>(p[2] - q[2])};
    };
    facet.slope = cross(difference(b, a), difference(c, a));
    const Vec3d& o = mesh_.points[static_cast<std::size_t>(triangle[0])];
    facet.normal = cross(mesh_.points[static_cast<std::size_t>(triangle[1])] - o,
                         mesh_.points[static_cast<std::size_t>(triangle[2])] - o);
    if (!(norm(facet.normal) > 0)) facet.normal = facet.slope;
    if (!(norm(facet.normal) > 0)) return;
    facet.normal *= 1 / norm(facet.normal);
    for (unsigned axis = 0; axis < 3; ++axis) project(facet, axis);
  }

 private:
  // Cell whose moved centre is the last one at or below integer coordinate v, and the first above.
  std::int64_t floor_cell(std::int64_t v) const { return (v - half_) >> bits_; }
  std::int64_t ceil_cell(std::int64_t v) const { return -((half_ - v) >> bits_); }
  std::int64_t center(std::int64_t cell) const { return (cell << bits_) + half_; }

  // Visits the lattice lines along `axis` within the projection of the facet.
  void project(const Facet& facet, unsigned axis) {
    const auto& [a, b, c] = facet.point;
    const unsigned i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;  // i < j: rows along i
    std::array<std::int64_t, 3> lo{}, hi{};
    for (unsigned d = 0; d < 3; ++d) {
      lo[d] = std::min({a[d], b[d], c[d]});
      hi[d] = std::max({a[d], b[d], c[d]});
    }
    const std::int64_t i0 = std::max<std::int64_t>(ceil_cell(lo[i]), 0);
    const std::int64_t i1 = std::min<std::int64_t>(floor_cell(hi[i]), lattice_.size[i] - 1);
    const std::int64_t j0 = std::max<std::int64_t>(ceil_cell(lo[j]), 0);
    const std::int64_t j1 = std::min<std::int64_t>(floor_cell(hi[j]), lattice_.size[j] - 1);
    Int3 p{};
    for (std::int64_t cj = j0; cj <= j1; ++cj)
      for (std::int64_t ci = i0; ci <= i1; ++ci) {
        p[i] = center(ci);
        p[j] = center(cj);
        p[axis] = 0;
        const int leaving = axis_line_crosses_triangle(static_cast<int>(axis), p, a, b, c);
        if (leaving == 0) continue;
        std::array<std::int64_t, 3> cell{};
        cell[i] = ci;
        cell[j] = cj;
        cross_line(facet, axis, leaving, lo[axis], hi[axis], p, cell);
      }
  }

  // Finds the link of the line through p that the facet crosses: a double says about where, the
  // exact predicate corrects it.
  void cross_line(const Facet& facet, unsigned axis, int leaving, std::int64_t lo, std::int64_t hi,
                  Int3 p, std::array<std::int64_t, 3> cell) {
    const auto& [a, b, c] = facet.point;
    const unsigned i = (axis + 1) % 3, j = (axis + 2) % 3;
    const auto slope = [&](unsigned d) { return facet.slope[static_cast<int>(d)]; };
    double height = static_cast<double>(lo);
    if (slope(axis) != 0)
      height = static_cast<double>(a[axis]) - (slope(i) * static_cast<double>(p[i] - a[i]) +
                                               slope(j) * static_cast<double>(p[j] - a[j])) /
                                                  slope(axis);
    height = std::clamp(height, static_cast<double>(lo), static_cast<double>(hi));
    std::int64_t lower = floor_cell(static_cast<std::int64_t>(height));
    const auto above = [&](std::int64_t k) {
      p[axis] = center(k);
      return side_of_plane(a, b, c, p) == leaving;
    };
    while (above(lower)) --lower;
    while (!above(lower + 1)) ++lower;

    const std::int64_t n = lattice_.size[axis];
    if (axis == 0 && lower >= 0) {
      const auto row =
          static_cast<std::size_t>(cell[1]) +
          static_cast<std::size_t>(lattice_.size[1]) * static_cast<std::size_t>(cell[2]);
      out_.row_start[row] += leaving;
    }
    if (lower < -1 || lower >= n) return;
    cell[axis] = lower;
    const double at = std::ldexp(height - static_cast<double>(center(lower)), -bits_);
    const Vec3i at_cell{static_cast<std::int32_t>(cell[0]), static_cast<std::int32_t>(cell[1]),
                        static_cast<std::int32_t>(cell[2])};
    out_.crossings.push_back(
        {lattice_.link_key(at_cell, static_cast<int>(axis)),
         std::clamp(at, 0.0, 1.0),
         leaving,
         {static_cast<float>(facet.normal.x), static_cast<float>(facet.normal.y),
          static_cast<float>(facet.normal.z)},
         facet.drawn});
  }

  const TriangleMesh& mesh_;
  const Lattice& lattice_;
  int bits_;
  std::int64_t half_;
  MeshCrossings& out_;
  std::vector<Int3> points_;
};

// Bits below the spacing that leave room for the mesh and the lattice.
int bits_below_spacing(const Box3& bounds, const Lattice& lattice) {
  double farthest = std::max({lattice.size[0], lattice.size[1], lattice.size[2]}) + 2;
  for (int d = 0; d < 3; ++d)
    farthest = std::max({farthest, std::abs(bounds.lo[d] - lattice.origin[d]) / lattice.spacing,
                         std::abs(bounds.hi[d] - lattice.origin[d]) / lattice.spacing});
  int bits = 0;
  std::frexp(farthest, &bits);
  expects(bits <= kRangeBits - 2, text("a mesh reaches ", farthest,
                                       " cells from the body; scale it, or choose larger cells"));
  return std::min(kFinestBits, kRangeBits - bits);
}

}  // namespace

MeshCrossings cross_lattice(const TriangleMesh& mesh, std::size_t drawn, const Lattice& lattice) {
  MeshCrossings out;
  out.row_start.assign(
      static_cast<std::size_t>(lattice.size[1]) * static_cast<std::size_t>(lattice.size[2]), 0);
  Rasteriser rasteriser(mesh, lattice, bits_below_spacing(mesh.bounds(), lattice), out);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    rasteriser.add(mesh.triangles[i], i < drawn);

  constexpr double kSamePlace = 1LL << 40;  // steps a link: rounding of `at` is far below one
  std::sort(out.crossings.begin(), out.crossings.end(),
            [](const MeshCrossing& a, const MeshCrossing& b) {
              if (a.link != b.link) return a.link < b.link;
              const double at_a = std::nearbyint(a.at * kSamePlace);
              const double at_b = std::nearbyint(b.at * kSamePlace);
              if (at_a != at_b) return at_a < at_b;
              return a.leaving > b.leaving;
            });
  return out;
}

}  // namespace kerf
