// SPDX-License-Identifier: MIT
//
// Products of level 0 without records: a block of threads makes what the cells around its vertices
// add, a chunk of cells after the other, in memory that the block shares, and each thread sums up
// for its own vertex. Cells between blocks are made by each of them. The sums have the order of
// incidences, as those of records have (products.hpp), and so the same bits.
//
// Per vertex of a uniform body in single precision, counted: cells 6, codes 16, row 12, slots 32,
// fold 2, rotation 16, kind 2, u and the result 24, some 105 bytes from memory where the edges of
// blocks are found in caches, in place of some 330; for 1.6 times the arithmetic.
//
// A body of blocks has `Shared`, which a block shares and finds filled with anything, `State`, one
// a thread and made anew for each block, phases(block), and operator()(phase, block, thread,
// shared, state); all threads of a block end a phase before any begins the next.
#pragma once

#include "gpu/bodies/products.hpp"

namespace kerf::gpu {

/// The codes of the incidences of some blocks of vertices; a thread a vertex.
struct WriteCodes {
  LevelView level;
  BlockView blocks;
  const std::int32_t* some;  ///< numbers of blocks; null: all
  std::uint16_t* codes;

  KERF_HD void operator()(std::int32_t i) const {
    const std::int32_t block = some != nullptr ? some[i / kBlockVertices] : i / kBlockVertices;
    const std::int32_t place = block * kBlockVertices + i % kBlockVertices;
    if (place >= level.vertices) return;
    const std::int32_t* const cells = blocks.cells + blocks.begin[block];
    const std::int32_t vertex = blocks.order[place], begin = level.incidence_begin[vertex];
    for (std::int32_t k = begin; k < begin + level.incidence_count[vertex]; ++k) {
      const std::int32_t cell = level.incidence[k] / kCorners;
      std::int32_t low = 0, high = blocks.count[block] - 1;
      while (low < high) {
        const std::int32_t middle = (low + high) / 2;
        if (cells[middle] < cell)
          low = middle + 1;
        else
          high = middle;
      }
      codes[k] = static_cast<std::uint16_t>(kCorners * low + level.incidence[k] % kCorners);
    }
  }
};

/// then(level, vertex, sum) with the sum of what the cells around each vertex add to it.
///
/// Shapes  a thread a vertex of the block in odd phases, a thread a cell of the chunk in even ones.
template <class T, class Cells, class Then>
struct BlockGather {
  static constexpr int kThreads = kBlockVertices;
  /// Of a multiprocessor, so that some work while others wait: what registers are shared out for.
  static constexpr int kBlocksAtOnce = sizeof(T) == sizeof(double) ? 2 : 3;
  struct Shared {
    T entry[kUnknowns][kThreads];
  };
  struct State {
    Vec3<T> sum{};
    std::int32_t next = 0;  // of the incidences of the vertex
  };

  LevelView level;
  BlockView blocks;
  Cells cells;
  Then then;

  KERF_HD std::int32_t chunks(std::int32_t block) const {
    const std::int32_t full = (blocks.count[block] + kThreads - 1) / kThreads;
    return full > 0 ? full : 1;
  }
  KERF_HD std::int32_t phases(std::int32_t block) const { return 2 * chunks(block); }

  KERF_HD void operator()(std::int32_t phase, std::int32_t block, int thread, Shared& shared,
                          State& state) const {
    const std::int32_t first = phase / 2 * kThreads;
    if (phase % 2 == 0)
      make(first + thread, block, thread, shared);
    else
      take(first + kThreads, block, thread, shared, state);
    if (phase + 1 == phases(block)) finish(block, thread, state);
  }

 private:
  KERF_HD void make(std::int32_t place, std::int32_t block, int thread, Shared& shared) const {
    if (place >= blocks.count[block]) return;
    Vec3<T> f[kCorners];
    cells.forces(level, blocks.cells[blocks.begin[block] + place], f);
    for (int i = 0; i < kCorners; ++i)
      for (int c = 0; c < 3; ++c) shared.entry[3 * i + c][thread] = f[i][c];
  }

  KERF_HD void take(std::int32_t end, std::int32_t block, int thread, const Shared& shared,
                    State& state) const {
    const std::int32_t place = block * kBlockVertices + thread;
    if (place >= level.vertices) return;
    const std::int32_t vertex = blocks.order[place];
    const std::int32_t count = level.incidence_count[vertex];
    const std::uint16_t* const codes = blocks.codes + level.incidence_begin[vertex];
    for (; state.next < count && codes[state.next] < kCorners * end; ++state.next) {
      const int from = codes[state.next] / kCorners % kThreads;
      const int entry = 3 * (codes[state.next] % kCorners);
      state.sum += Vec3<T>{shared.entry[entry][from], shared.entry[entry + 1][from],
                           shared.entry[entry + 2][from]};
    }
  }

  KERF_HD void finish(std::int32_t block, int thread, const State& state) const {
    const std::int32_t place = block * kBlockVertices + thread;
    if (place < level.vertices) then(level, blocks.order[place], state.sum);
  }
};

}  // namespace kerf::gpu
