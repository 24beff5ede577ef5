// SPDX-License-Identifier: MIT
//
// Coarse matrices: six threads a coarse cell, one for each pair of components, whose 64 scalars
// fit into registers (kernels/component_coarsen.hpp; in double those of stored children spill).
// Threads side by side have cells side by side. Plain cells, most of them, have bodies of their
// own, without weights; the others loop over weights.
#pragma once

#include "gpu/bodies/values.hpp"
#include "kernels/component_coarsen.hpp"

namespace kerf::gpu {

/// Whether a coarse cell is plain: neither it nor a child has hanging corners, no child is passed
/// on, and, of children on level 0, no component of theirs is held, and their places ascend.
struct MarkPlain {
  LevelView fine, coarse;
  bool is_finest;
  std::uint8_t* plain;

  KERF_HD void operator()(std::int32_t cell) const {
    bool is_plain = !kernels::has_hanging(coarse.fold[cell]);
    int before = -1;
    const std::int32_t begin = coarse.child_begin[cell];
    for (std::int32_t k = begin; k < begin + coarse.child_count[cell] && is_plain; ++k) {
      const std::int32_t child = coarse.children[k];
      const int place = fine.place[child];
      is_plain = !kernels::has_hanging(fine.fold[child]) && place != kernels::kPassed;
      if (!is_finest) continue;
      is_plain = is_plain && place > before && held(child) == 0;
      before = place;
    }
    plain[cell] = is_plain ? 1 : 0;
  }

 private:
  KERF_HD int held(std::int32_t child) const {
    int all = 0;
    for (int i = 0; i < kCorners; ++i) all |= fine.fixed[fine.slot(child, i)];
    return all;
  }
};

/// What a thread has to do.
struct CoarsenTask {
  std::int32_t cell;
  kernels::ComponentPair pair;
};
inline constexpr int kTile = 1 << kTileLog2;
KERF_HD std::int32_t coarsen_tasks(std::int32_t cells) {
  return (cells + kTile - 1) / kTile * kTile * kernels::kComponentPairs;
}
KERF_HD CoarsenTask coarsen_task(std::int32_t i) {
  const std::int32_t tile = i / (kTile * kernels::kComponentPairs);
  return {tile * kTile + i % kTile, kernels::component_pair(i / kTile % kernels::kComponentPairs)};
}

template <class T>
using Component = T[kCorners][kCorners];

template <class T>
KERF_HD void load_component(const T* matrices, std::int32_t cell, kernels::ComponentPair pair,
                            Component<T>& A) {
  const auto from =
      kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2);
  kernels::unrolled<kCorners>([&](auto p) {
    kernels::unrolled<kCorners>([&](auto q) { A[p][q] = from[kernels::pair_entry(p, q, pair)]; });
  });
}

/// Of the two places of an entry of a symmetric pair the lower one is stored.
template <class T>
KERF_HD void store_component(T* matrices, std::int32_t cell, kernels::ComponentPair pair,
                             const Component<T>& A) {
  const auto to =
      kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2);
  const bool same = pair.i == pair.k;
  kernels::unrolled<kCorners>([&](auto p) {
    kernels::unrolled<kCorners>([&](auto q) {
      if (p >= q || !same) to[kernels::pair_entry(p, q, pair)] = A[p][q];
    });
  });
}

template <class T>
KERF_HD void finest_forces(const FinestView<T>& finest, std::int32_t cell,
                           kernels::ComponentPair pair, T (&forces)[10]) {
  kernels::component_forces(rotation_of(finest, cell), finest.stiffness(cell), finest.inertia(cell),
                            finest.material(cell).modes.stiffness, pair, forces);
}

/// Plain cells of level 1.
template <class T>
struct CoarsenFinestPlain {
  LevelView fine, coarse;
  FinestView<T> finest;
  const std::uint8_t* plain;
  T* matrices;

  KERF_HD void operator()(std::int32_t i) const {
    const CoarsenTask task = coarsen_task(i);
    if (task.cell >= coarse.cells || plain[task.cell] == 0) return;
    std::int32_t k = coarse.child_begin[task.cell];
    const std::int32_t end = k + coarse.child_count[task.cell];
    T sums[10][kCorners];
    kernels::unrolled<kCorners>([&](auto octant) {
      T forces[10] = {};
      const std::int32_t child = k < end ? coarse.children[k] : -1;
      if (child >= 0 && fine.place[child] == octant) {
        finest_forces(finest, child, task.pair, forces);
        ++k;
      }
      kernels::unrolled<10>([&](auto q) { sums[q][octant] = forces[q]; });
    });
    kernels::component_sums(sums);
    Component<T> A;
    kernels::component_parent(sums, finest.materials[0].modes.mass, A);
    store_component(matrices, task.cell, task.pair, A);
  }
};

/// Sums over children, of plain cells or of the others as `Children::kPlain` says;
/// children.add(fine, coarse, child, task, sum).
template <class T, class Children>
struct CoarsenSums {
  LevelView fine, coarse;
  Children children;
  const std::uint8_t* plain;
  T* matrices;

  KERF_HD void operator()(std::int32_t i) const {
    const CoarsenTask task = coarsen_task(i);
    if (task.cell >= coarse.cells || (plain[task.cell] != 0) != Children::kPlain) return;
    Component<T> sum;
    kernels::unrolled<kCorners>(
        [&](auto p) { kernels::unrolled<kCorners>([&](auto q) { sum[p][q] = T(0); }); });
    const std::int32_t begin = coarse.child_begin[task.cell];
    for (std::int32_t k = begin; k < begin + coarse.child_count[task.cell]; ++k)
      children.add(fine, coarse, coarse.children[k], task, sum);
    store_component(matrices, task.cell, task.pair, sum);
  }
};

/// The others of level 1.
template <class T>
struct FinestChildren {
  static constexpr bool kPlain = false;
  FinestView<T> finest;

  KERF_HD void add(const LevelView& fine, const LevelView& coarse, std::int32_t child,
                   const CoarsenTask& task, Component<T>& sum) const {
    T forces[10];
    Component<T> A, left, right;
    finest_forces(finest, child, task.pair, forces);
    kernels::component_matrix(forces, finest.materials[0].modes.mass, A);
    const auto weigh = [&](int component, Component<T>& weights) {
      unsigned held = 0;
      for (int s = 0; s < kCorners; ++s)
        held |= ((fine.fixed[fine.slot(child, s)] >> component) & 1U) << s;
      kernels::corner_weights(fine.fold[child], fine.place[child], coarse.fold[task.cell], held,
                              weights);
    };
    weigh(task.pair.i, left);
    weigh(task.pair.k, right);
    kernels::add_weighted(A, left, right, sum);
  }
};

/// Plain cells of a higher level, and the others.
template <class T, bool plain>
struct StoredChildren {
  static constexpr bool kPlain = plain;
  const T* matrices;

  KERF_HD void add(const LevelView& fine, const LevelView& coarse, std::int32_t child,
                   const CoarsenTask& task, Component<T>& sum) const {
    Component<T> A;
    load_component(matrices, child, task.pair, A);
    if constexpr (plain) {
      kernels::restrict_component(fine.place[child], A);
      kernels::unrolled<kCorners>(
          [&](auto p) { kernels::unrolled<kCorners>([&](auto q) { sum[p][q] += A[p][q]; }); });
    } else {
      Component<T> weights;
      kernels::transfer_weights(fine.fold[child], fine.place[child], coarse.fold[task.cell],
                                weights);
      kernels::add_weighted(A, weights, weights, sum);
    }
  }
};

}  // namespace kerf::gpu
