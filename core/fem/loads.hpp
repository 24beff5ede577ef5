// SPDX-License-Identifier: MIT
//
// Supports and loads on the vertices of level 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/setup.hpp"

namespace kerf {

/// A component of a vertex that is held elsewhere than at zero.
struct HeldComponent {
  std::size_t component = 0;  ///< 3 vertex + axis
  double displacement = 0;    ///< m
};

/// Sets level.fixed from the supports (later ones win) for the vertices from `first` on. `held`,
/// ascending, keeps what it has of the vertices before.
void apply_supports(const Lattice& lattice, const std::vector<Support>& supports, Level& level,
                    std::int32_t first, std::vector<HeldComponent>& held);

/// External forces on the vertices, N. Reference state; hanging corners pass their share to their
/// masters.
class ExternalForce {
 public:
  /// @throws Error (bad_input) if a box force meets no cell.
  ExternalForce(const Lattice& lattice, const std::vector<Load>& loads, const Level& level);

  /// 3 per vertex.
  std::vector<double> on_all(const Hierarchy& hierarchy) const;
  /// The same bits, 3 for each of some vertices.
  std::vector<double> on(const Hierarchy& hierarchy, std::span<const std::int32_t> vertices) const;

 private:
  void on_slots(const Hierarchy& hierarchy, std::size_t load, std::int32_t cell, unsigned wanted,
                Vec3d (&slots)[8]) const;

  Lattice lattice_;
  std::vector<Load> loads_;
  std::vector<double> covered_;  // per load: the finest cells in its box; cuts do not change them
};

}  // namespace kerf
