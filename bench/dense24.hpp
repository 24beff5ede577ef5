// SPDX-License-Identifier: MIT
//
// Baseline of the operator: R K R^T u by a full 24x24 product for each cell, gathered by the same
// two passes as the CPU backend does. What the basis of modes (kernels/modes.hpp) has to beat.
#pragma once

#include <span>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "kernels/hex_element.hpp"

namespace kerf::bench {

class Dense24 {
 public:
  /// `rotations`: four doubles a cell, as Backend::read_rotations gives them. The hierarchy must
  /// outlive the object; all cells are of its first material.
  Dense24(const Hierarchy& hierarchy, std::span<const double> rotations, int threads);

  /// out = A in, without mass; held components of `in` must be zero, those of `out` become zero.
  void apply(std::span<const double> in, std::span<double> out);

 private:
  const Hierarchy& hierarchy_;
  int threads_;
  kernels::HexStiffness<double> K_;
  std::vector<kernels::Quat<double>> rotation_;
  std::vector<Vec3d> products_;  // 8 a cell
};

}  // namespace kerf::bench
