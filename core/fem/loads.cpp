// SPDX-License-Identifier: MIT
#include "core/fem/loads.hpp"

#include <cmath>
#include <variant>

#include "core/base/error.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

Vec3d cell_center(const Lattice& lattice, const Level& level, std::int32_t cell) {
  const double half = 0.5 * lattice.spacing * (1 << level.size_log2[cell]);
  return lattice.point(level.corner[cell]) + Vec3d{half, half, half};
}

// Finest cells of a leaf with their centre in a box, and their shares of its corners. Finest cells,
// so that a force does not jump when a cut refines the leaf.
struct Covered {
  double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};  // along each axis, sums of 1 - t and of t

  Covered(const Lattice& lattice, const Level& level, std::int32_t cell, const Box3& box) {
    const int size = 1 << level.size_log2[cell];
    for (int i = 0; i < size; ++i) {
      Vec3i at = level.corner[cell];
      for (std::size_t d = 0; d < 3; ++d) at[d] += i;
      const Vec3d center = lattice.center(at);
      const double t = (i + 0.5) / size;
      for (int d = 0; d < 3; ++d) {
        if (center[d] < box.lo[d] || center[d] > box.hi[d]) continue;
        low[d] += 1 - t;
        high[d] += t;
      }
    }
  }
  double cells() const { return (low[0] + high[0]) * (low[1] + high[1]) * (low[2] + high[2]); }
  double corner(int i) const {
    return ((i & 1) != 0 ? high[0] : low[0]) * ((i & 2) != 0 ? high[1] : low[1]) *
           ((i & 4) != 0 ? high[2] : low[2]);
  }
};

Vec3d away_from_axis(const RadialForce& load, const Vec3d& p) {
  const Vec3d axis = (1 / norm(load.axis)) * load.axis;
  const Vec3d d = p - load.point;
  const Vec3d radial = d - dot(d, axis) * axis;
  const double length = norm(radial);
  return length > 0 ? (1 / length) * radial : Vec3d{};
}

}  // namespace

void apply_supports(const Lattice& lattice, const std::vector<Support>& supports, Level& level,
                    std::int32_t first, std::vector<HeldComponent>& held) {
  while (!held.empty() && held.back().component >= 3 * static_cast<std::size_t>(first))
    held.pop_back();
  for (std::int32_t v = first; v < level.vertices(); ++v) {
    level.fixed[v] = 0;
    Vec3d displacement{};
    const Vec3d p = lattice.point(level.point[v]);
    for (const Support& support : supports) {
      if (!support.box.contains(p)) continue;
      for (int c = 0; c < 3; ++c)
        if (support.held[c]) {
          level.fixed[v] = static_cast<std::uint8_t>(level.fixed[v] | (1 << c));
          displacement[c] = support.displacement[c];
        }
    }
    for (int c = 0; c < 3; ++c)
      if (displacement[c] != 0)
        held.push_back(
            {3 * static_cast<std::size_t>(v) + static_cast<std::size_t>(c), displacement[c]});
  }
}

ExternalForce::ExternalForce(const Lattice& lattice, const std::vector<Load>& loads,
                             const Level& level)
    : lattice_(lattice), loads_(loads), covered_(loads.size(), 0.0) {
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const auto* box = std::get_if<BoxForce>(&loads_[i]);
    if (box == nullptr) continue;
    for (std::int32_t c = 0; c < level.cells(); ++c)
      covered_[i] += Covered(lattice_, level, c, box->box).cells();
    expects(covered_[i] > 0,
            "the box of a force holds no centre of a finest cell; enlarge or move it");
  }
}

// What one load does to the wanted slots (a bit each) of one cell. A body force is spread evenly
// over it, and reaches its corners in equal shares.
void ExternalForce::on_slots(const Hierarchy& hierarchy, std::size_t load, std::int32_t cell,
                             unsigned wanted, Vec3d (&slots)[8]) const {
  const Level& level = hierarchy.levels[0];
  const bool hangs = (level.fold[cell] & 255) != 0;
  if (hangs) wanted = 255;
  Vec3d corners[8];
  Vec3d(&out)[8] = hangs ? corners : slots;
  if (const auto* box = std::get_if<BoxForce>(&loads_[load])) {
    const Covered covered(lattice_, level, cell, box->box);
    const bool none = covered.cells() == 0;
    for (int i = 0; i < 8; ++i)
      out[i] = none ? Vec3d{} : (covered.corner(i) / covered_[load]) * box->force;
  } else {
    Vec3d force{};
    if (const auto* gravity = std::get_if<Gravity>(&loads_[load]))
      force = hierarchy.values[cell].mass * gravity->acceleration;
    else if (const auto* radial = std::get_if<RadialForce>(&loads_[load]))
      force = hierarchy.values[cell].mass * radial->strength *
              away_from_axis(*radial, cell_center(lattice_, level, cell));
    for (int i = 0; i < 8; ++i)
      if ((wanted >> i & 1) != 0) out[i] = 0.125 * force;
  }
  if (hangs) kernels::fold_transpose(corners, level.fold[cell], slots);
}

std::vector<double> ExternalForce::on_all(const Hierarchy& hierarchy) const {
  const Level& level = hierarchy.levels[0];
  std::vector<double> out(3 * level.point.size(), 0.0);
  for (std::size_t load = 0; load < loads_.size(); ++load)
    for (std::int32_t c = 0; c < level.cells(); ++c) {
      Vec3d slots[8];
      on_slots(hierarchy, load, c, 255, slots);
      for (int i = 0; i < 8; ++i)
        for (int d = 0; d < 3; ++d)
          out[3 * static_cast<std::size_t>(level.slots[c][i]) + d] += slots[i][d];
    }
  return out;
}

std::vector<double> ExternalForce::on(const Hierarchy& hierarchy,
                                      std::span<const std::int32_t> vertices) const {
  const Level& level = hierarchy.levels[0];
  std::vector<double> out(3 * vertices.size(), 0.0);
  for (std::size_t k = 0; k < vertices.size(); ++k)
    for (std::size_t load = 0; load < loads_.size(); ++load)
      for (const std::int32_t item : level.incidences_of(vertices[k])) {
        Vec3d slots[8];
        on_slots(hierarchy, load, item / 8, 1U << (item % 8), slots);
        for (int d = 0; d < 3; ++d) out[3 * k + d] += slots[item % 8][d];
      }
  return out;
}

}  // namespace kerf
