// SPDX-License-Identifier: MIT
//
// Rotations, matrices and diagonal blocks: one thread a cell or a vertex.
//
// Layout  level_view.hpp. Matrices are over slots; rows and columns of held components are zero.
#pragma once

#include <type_traits>

#include "gpu/level_view.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/residual.hpp"
#include "kernels/rotation.hpp"
#include "kernels/transfer.hpp"

namespace kerf::gpu {

template <class T>
KERF_HD Mat3<T> rotation_of(const FinestView<T>& finest, std::int32_t cell) {
  return kernels::to_matrix(finest.rotation(cell));
}

/// Level 0: R of a cell from the displacements, in double; where the cycle is single, by steps in
/// single precision but for the last.
template <class S>
struct RotateCell {
  LevelView level;
  const std::uint8_t* size_log2;
  double spacing;
  const double* displacement;
  RotationView rotations;

  KERF_HD void operator()(std::int32_t cell) const {
    Vec3<double> slots[kCorners], corners[kCorners];
    load_slots(level, cell, displacement, slots);
    kernels::unfold(slots, level.fold[cell], corners);
    const double side = spacing * static_cast<double>(1 << size_log2[cell]);
    const Mat3<double> F = kernels::mean_gradient(corners, side);
    const Quat<double> before = rotations.get<double>(cell);
    if constexpr (std::is_same_v<S, double>)
      rotations.set(cell, kernels::extract_rotation(F, before));
    else
      rotations.set(cell, kernels::extract_rotation_mixed(F, before));
  }
};

/// New cells turn as those they were a part of.
struct InheritRotation {
  const std::int32_t* origin;
  std::int32_t first;
  RotationView rotations;

  KERF_HD void operator()(std::int32_t i) const {
    rotations.set(first + i, rotations.get<double>(origin[i]));
  }
};

/// No rotation.
struct StraightenCell {
  RotationView rotations;

  KERF_HD void operator()(std::int32_t cell) const { rotations.set(cell, Quat<double>{}); }
};

/// The matrix of a finest cell over its slots.
template <class T, class Out>
KERF_HD void finest_matrix(const LevelView& level, const FinestView<T>& finest, std::int32_t cell,
                           Out out) {
  T packed[kEntries];
  kernels::cell_matrix(finest.material(cell).stiffness, *finest.mass, rotation_of(finest, cell),
                       finest.stiffness(cell), finest.inertia(cell), static_cast<T*>(packed));
  const std::uint16_t fold = level.fold[cell];
  if (kernels::has_hanging(fold)) {
    T weights[kCorners][kCorners];
    kernels::fold_weights(fold, weights);
    for (int e = 0; e < kEntries; ++e) out[e] = T(0);
    kernels::coarsen_cell(static_cast<const T*>(packed), weights, out);
  } else {
    for (int e = 0; e < kEntries; ++e) out[e] = packed[e];
  }
  for (int p = 0; p < kUnknowns; ++p) {
    if (((level.fixed[level.slot(cell, p / 3)] >> (p % 3)) & 1) == 0) continue;
    for (int q = 0; q < kUnknowns; ++q)
      out[p >= q ? kernels::packed_index(p, q) : kernels::packed_index(q, p)] = T(0);
  }
}

template <class T>
struct FinestMatrix {
  LevelView level;
  FinestView<T> finest;
  T* matrices;

  KERF_HD void operator()(std::int32_t cell) const {
    finest_matrix(
        level, finest, cell,
        kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2));
  }
};

/// One matrix on its way to the host.
struct OneFinestMatrix {
  LevelView level;
  FinestView<double> finest;
  std::int32_t cell;
  double* out;

  KERF_HD void operator()(std::int32_t) const { finest_matrix(level, finest, cell, out); }
};
template <class T>
struct OneStoredMatrix {
  const T* matrices;
  std::int32_t cell;
  double* out;

  KERF_HD void operator()(std::int32_t entry) const {
    out[entry] = static_cast<double>(matrices[kernels::tile_index(
        static_cast<std::size_t>(cell), static_cast<std::size_t>(entry), kEntries, kTileLog2)]);
  }
};

/// The block of a slot of a finest cell with itself, held components included.
template <class T>
KERF_HD Sym3<T> finest_block(const LevelView& level, const FinestView<T>& finest, std::int32_t cell,
                             int slot) {
  const kernels::HexStiffness<T>& K = finest.material(cell).stiffness;
  const Mat3<T> R = rotation_of(finest, cell);
  const T stiffness = finest.stiffness(cell), mass = finest.inertia(cell);
  const std::uint16_t fold = level.fold[cell];
  if (!kernels::has_hanging(fold))
    return kernels::cell_diagonal(K, *finest.mass, R, stiffness, mass, slot);
  // Only the few corners that this slot speaks for.
  T weights[kCorners][kCorners];
  kernels::fold_weights(fold, weights);
  Mat3<T> sum;
  for (int k = 0; k < kCorners; ++k)
    for (int l = 0; l < kCorners; ++l) {
      const T w = weights[k][slot] * weights[l][slot];
      if (w != T(0))
        sum += kernels::rotate_block(K, *finest.mass, R, w * stiffness, w * mass, k, l);
    }
  return kernels::lower_triangle(sum);
}

template <class T>
KERF_HD Sym3<T> inverse_of_free(Sym3<T> block, std::uint8_t fixed) {
  if ((fixed & 1) != 0) block.xx = block.xy = block.xz = T(0);
  if ((fixed & 2) != 0) block.yy = block.xy = block.yz = T(0);
  if ((fixed & 4) != 0) block.zz = block.xz = block.yz = T(0);
  return kernels::inverse_semidefinite(block);
}

/// D^-1 of a vertex of level 0.
template <class T>
struct InvertFinest {
  LevelView level;
  FinestView<T> finest;
  Sym3<T>* inverse;

  KERF_HD void operator()(std::int32_t vertex) const {
    const std::int32_t* const incidence = level.incidence + level.incidence_begin[vertex];
    Sym3<T> sum{};
    for (std::int32_t k = 0; k < level.incidence_count[vertex]; ++k)
      sum += finest_block(level, finest, incidence[k] / kCorners, incidence[k] % kCorners);
    inverse[vertex] = inverse_of_free(sum, level.fixed[vertex]);
  }
};

/// D^-1 of a vertex of a higher level.
template <class T>
struct InvertStored {
  LevelView level;
  const T* matrices;
  Sym3<T>* inverse;

  KERF_HD void operator()(std::int32_t vertex) const {
    const std::int32_t* const incidence = level.incidence + level.incidence_begin[vertex];
    Sym3<T> sum{};
    for (std::int32_t k = 0; k < level.incidence_count[vertex]; ++k) {
      const auto A = kernels::cell_entries(
          matrices, static_cast<std::size_t>(incidence[k] / kCorners), kEntries, kTileLog2);
      sum += kernels::packed_diagonal<T>(A, incidence[k] % kCorners);
    }
    inverse[vertex] = inverse_of_free(sum, level.fixed[vertex]);
  }
};

}  // namespace kerf::gpu
