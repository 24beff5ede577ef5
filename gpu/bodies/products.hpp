// SPDX-License-Identifier: MIT
//
// Products, smoothing and transfer. Two passes make each free of conflicts: a thread a cell writes
// what the cell adds to its slots, then a thread a vertex gathers its incidences in their order and
// finishes with the sum (residual, step of Chebyshev). No atomics, and the same bits in any order
// of threads. On level 0 one pass does both: blocks.hpp.
//
// Layout  level_view.hpp.
#pragma once

#include "gpu/bodies/values.hpp"
#include "gpu/bodies/vectors.hpp"
#include "kernels/relax.hpp"
#include "kernels/transfer.hpp"

namespace kerf::gpu {

// ---- a thread a cell -------------------------------------------------------------------------

/// f = (stiffness [R] K [R]^T + mass M) u of a finest cell over its slots; f may be u.
template <class T>
KERF_HD void finest_product(const LevelView& level, const FinestView<T>& finest, std::int32_t cell,
                            const Vec3<T> (&u)[kCorners], Vec3<T> (&f)[kCorners]) {
  const Mat3<T> R = rotation_of(finest, cell);
  const kernels::ModeConstants<T>& constants = finest.material(cell).modes;
  const T stiffness = finest.stiffness(cell), mass = finest.inertia(cell);
  const std::uint16_t fold = level.fold[cell];
  if (!kernels::has_hanging(fold)) {
    kernels::apply_cell(u, R, stiffness, mass, constants, f);
    return;
  }
  Vec3<T> corners[kCorners];
  kernels::unfold(u, fold, corners);
  kernels::apply_cell(corners, R, stiffness, mass, constants, corners);
  kernels::fold_transpose(corners, fold, f);
}

/// Products of cells of level 0 with u, which may be of another precision.
template <class T, class From = T>
struct FinestCells {
  FinestView<T> finest;
  const From* u;

  KERF_HD void forces(const LevelView& level, std::int32_t cell, Vec3<T> (&f)[kCorners]) const {
    load_slots(level, cell, u, f);
    finest_product(level, finest, cell, f, f);
  }
};

/// Products of cells that have a matrix.
template <class T>
struct StoredCells {
  const T* matrices;
  const T* u;

  KERF_HD void forces(const LevelView& level, std::int32_t cell, Vec3<T> (&f)[kCorners]) const {
    Vec3<T> at[kCorners];
    load_slots(level, cell, u, at);
    kernels::apply_packed(
        kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2), at,
        f);
  }
};

/// Elastic forces of cells; see kernels/modes.hpp.
struct ElasticCells {
  FinestView<double> finest;
  const double* displacement;

  KERF_HD void forces(const LevelView& level, std::int32_t cell,
                      Vec3<double> (&f)[kCorners]) const {
    Vec3<double> corners[kCorners];
    load_slots(level, cell, displacement, f);
    kernels::unfold(f, level.fold[cell], corners);
    kernels::elastic_force(corners, finest.rotation(cell), finest.side(cell),
                           finest.unscaled_stiffness(cell), finest.material(cell).modes.stiffness,
                           corners);
    kernels::fold_transpose(corners, level.fold[cell], f);
  }
};

/// What a cell adds to its slots, as a record.
template <class T, class Cells>
struct RecordCell {
  LevelView level;
  Cells cells;
  T* records;

  KERF_HD void operator()(std::int32_t cell) const {
    Vec3<T> f[kCorners];
    cells.forces(level, cell, f);
    store_record(records, cell, f);
  }
};

// ---- what becomes of the sum at a vertex -------------------------------------------------------

/// out = the sum.
template <class T, class To = T>
struct SumTo {
  To* out;
  bool masks;

  KERF_HD void operator()(const LevelView& level, std::int32_t vertex, const Vec3<T>& sum) const {
    store(out, vertex, as<To>(masks ? masked(sum, level.fixed[vertex]) : sum));
  }
};

/// r = f - the sum.
template <class T, class To = T>
struct ResidualTo {
  const T* f;
  To* r;

  KERF_HD void operator()(const LevelView& level, std::int32_t vertex, const Vec3<T>& sum) const {
    store(r, vertex, as<To>(load(f, vertex) - masked(sum, level.fixed[vertex])));
  }
};

/// A step of Chebyshev acceleration of block Jacobi: d = keep d + take D^-1 (f - the sum), and u +
/// d goes to `to`. Where cells are still to be read, that may not be u itself.
///
/// Shapes  factors: take and keep of this step; on the device, since they change with the operator.
/// Source  Adams, Brezina, Hu, Tuminaro 2003 [ABHT03]; Saad 2003, algorithm 12.1.
template <class T>
struct ChebyshevTo {
  const Sym3<T>* inverse;
  const T* factors;
  const T* f;
  T* d;
  const T* u;  ///< null: zero
  T* to;

  KERF_HD void operator()(const LevelView& level, std::int32_t vertex, const Vec3<T>& sum) const {
    const Vec3<T> r = load(f, vertex) - masked(sum, level.fixed[vertex]);
    const Vec3<T> before = u != nullptr ? load(u, vertex) : Vec3<T>{};
    Vec3<T> direction = factors[0] * (inverse[vertex] * r);
    if (factors[1] != T(0)) direction += factors[1] * load(static_cast<const T*>(d), vertex);
    store(d, vertex, direction);
    store(to, vertex, before + direction);
  }
};

/// A thread a vertex: the sum of records.
template <class T, class Then>
struct GatherVertex {
  LevelView level;
  const T* records;
  Then then;

  KERF_HD void operator()(std::int32_t vertex) const {
    then(level, vertex, gather_records(level, records, vertex));
  }
};

/// The same where u is zero, and with it the sum.
template <class T, class Then>
struct EachVertex {
  LevelView level;
  Then then;

  KERF_HD void operator()(std::int32_t vertex) const { then(level, vertex, Vec3<T>{}); }
};

/// out = D^-1 in
template <class T, class From, class To>
struct JacobiBody {
  const Sym3<T>* inverse;
  const From* in;
  To* out;

  KERF_HD void operator()(std::int32_t vertex) const {
    store(out, vertex, as<To>(inverse[vertex] * as<T>(load(in, vertex))));
  }
};

// ---- Gauss-Seidel ----------------------------------------------------------------------------

/// Row of A u that belongs to a slot of a finest cell.
template <class T>
KERF_HD Vec3<T> finest_row(const LevelView& level, const FinestView<T>& finest, std::int32_t cell,
                           int slot, const T* u) {
  Vec3<T> at[kCorners];
  load_slots(level, cell, u, at);
  if (kernels::has_hanging(level.fold[cell])) {
    finest_product(level, finest, cell, at, at);
    return at[slot];
  }
  const kernels::HexStiffness<T>& K = finest.material(cell).stiffness;
  const Mat3<T> R = rotation_of(finest, cell);
  Vec3<T> elastic{}, inertia{};
  for (int j = 0; j < kCorners; ++j) {
    const Vec3<T> local = kernels::transpose_times(R, at[j]);
    for (int a = 0; a < 3; ++a) {
      const T* const row = K.k[3 * slot + a] + 3 * j;
      elastic[a] += row[0] * local.x + row[1] * local.y + row[2] * local.z;
    }
    inertia += finest.mass->m[slot][j] * at[j];
  }
  return finest.stiffness(cell) * (R * elastic) + finest.inertia(cell) * inertia;
}

/// One colour: no two of its vertices share a cell.
template <class T, bool is_finest>
struct RelaxVertex {
  LevelView level;
  FinestView<T> finest;  ///< of level 0
  const T* matrices;     ///< of the others
  const Sym3<T>* inverse;
  const std::int32_t* vertices;
  T omega;
  const T* f;
  T* u;

  KERF_HD void operator()(std::int32_t i) const {
    const std::int32_t vertex = vertices[i];
    const std::int32_t* const incidence = level.incidence + level.incidence_begin[vertex];
    Vec3<T> r = load(f, vertex);
    for (std::int32_t k = 0; k < level.incidence_count[vertex]; ++k)
      r -= row(incidence[k] / kCorners, incidence[k] % kCorners);
    store(u, vertex,
          kernels::relax_vertex(load(static_cast<const T*>(u), vertex), r, inverse[vertex], omega));
  }

 private:
  KERF_HD Vec3<T> row(std::int32_t cell, int slot) const {
    if constexpr (is_finest) {
      return finest_row(level, finest, cell, slot, static_cast<const T*>(u));
    } else {
      Vec3<T> at[kCorners];
      load_slots(level, cell, static_cast<const T*>(u), at);
      return kernels::apply_packed_row(
          kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2),
          slot, at);
    }
  }
};

// ---- transfer --------------------------------------------------------------------------------

/// The first incidence of a vertex, which speaks for it: a vertex counts once, although many cells
/// meet it.
struct FindFirst {
  LevelView level;
  std::int32_t* first;

  KERF_HD void operator()(std::int32_t vertex) const {
    first[vertex] = level.incidence[level.incidence_begin[vertex]];
  }
};
/// Of which of its slots a cell is the first: a bit each.
struct MarkFirst {
  LevelView level;
  const std::int32_t* first;
  std::uint8_t* slots;

  KERF_HD void operator()(std::int32_t cell) const {
    int bits = 0;
    for (int i = 0; i < kCorners; ++i)
      bits |= (first[level.slot(cell, i)] == kCorners * cell + i ? 1 : 0) << i;
    slots[cell] = static_cast<std::uint8_t>(bits);
  }
};

/// What the children of a coarse cell hand to its slots: to its corners first, all of them, then
/// those that hang hand on to the slots (kernels/transfer.hpp).
template <class T>
struct RestrictCell {
  LevelView fine, coarse;
  const std::uint8_t* first_slots;  ///< of fine cells, MarkFirst
  const T* r;
  T* records;

  KERF_HD void operator()(std::int32_t cell) const {
    Vec3<T> sum[kCorners];
    const std::int32_t begin = coarse.child_begin[cell];
    const std::int32_t end = begin + coarse.child_count[cell];
    const std::uint16_t fold = coarse.fold[cell];
    if (fine.place[coarse.children[begin]] == kernels::kPassed) {
      load_spoken(coarse.children[begin], sum);
    } else {
      for (std::int32_t k = begin; k < end; ++k) add(coarse.children[k], sum);
      if (kernels::has_hanging(fold)) hand_on(fold, sum);
    }
    store_record(records, cell, sum);
  }

 private:
  /// What the slots hold that this cell speaks for.
  KERF_HD void load_spoken(std::int32_t child, Vec3<T> (&v)[kCorners]) const {
    const int bits = first_slots[child];
    kernels::unrolled<kCorners>(
        [&](auto i) { v[i] = ((bits >> i) & 1) != 0 ? load(r, fine.slot(child, i)) : Vec3<T>{}; });
  }
  /// A hanging slot of a child is the corner of its parent.
  KERF_HD void add(std::int32_t child, Vec3<T> (&sum)[kCorners]) const {
    const std::uint16_t fold = fine.fold[child];
    const int place = fine.place[child];
    Vec3<T> v[kCorners];
    load_spoken(child, v);
    kernels::unrolled<kCorners>([&](auto i) {
      if (!kernels::is_hanging(fold, i)) return;
      sum[i] += v[i];
      v[i] = {};
    });
    kernels::restrict_plain<T>(place, v);
    kernels::unrolled<kCorners>([&](auto m) { sum[m] += v[m]; });
  }
  KERF_HD void hand_on(std::uint16_t fold, Vec3<T> (&sum)[kCorners]) const {
    Vec3<T> slots[kCorners];
    kernels::fold_transpose(sum, fold, slots);
    kernels::unrolled<kCorners>([&](auto m) { sum[m] = slots[m]; });
  }
};

/// u += P times the coarse solution, of a fine vertex.
template <class T>
struct ProlongVertex {
  LevelView fine, coarse;
  const std::int32_t* first;  ///< of fine vertices, FindFirst
  const T* from;
  T* u;

  KERF_HD void operator()(std::int32_t vertex) const {
    const std::int32_t child = first[vertex] / kCorners, cell = fine.parent[child];
    const int corner = first[vertex] % kCorners, place = fine.place[child];
    const Vec3<T> change = place == kernels::kPassed ? load(from, coarse.slot(cell, corner))
                                                     : mean(child, cell, place, corner);
    store(u, vertex, load(static_cast<const T*>(u), vertex) + masked(change, fine.fixed[vertex]));
  }

 private:
  /// Of the parent's corners between the child's own one and this one; a hanging slot is the corner
  /// of the parent itself.
  KERF_HD Vec3<T> mean(std::int32_t child, std::int32_t cell, int place, int corner) const {
    const std::uint16_t fold = coarse.fold[cell];
    const int own = kernels::is_hanging(fine.fold[child], corner) ? corner : place;
    T weight[kCorners];
    kernels::unrolled<kCorners>([&](auto m) {
      weight[m] =
          kernels::is_between(own, corner, m) && !kernels::is_hanging(fold, m) ? T(1) : T(0);
    });
    if (kernels::has_hanging(fold)) hand_on(own, corner, fold, weight);
    Vec3<T> sum{};
    kernels::unrolled<kCorners>([&](auto m) {
      if (weight[m] != T(0)) sum += weight[m] * load(from, coarse.slot(cell, m));
    });
    return kernels::mean_weight<T>(own ^ corner) * sum;
  }
  /// Adds to the weights of slots what corners that hang are made of.
  KERF_HD void hand_on(int own, int corner, std::uint16_t fold, T (&weight)[kCorners]) const {
    const int o = kernels::fold_octant(fold);
    for (int j = 0; j < kCorners; ++j) {
      if (!kernels::is_hanging(fold, j) || !kernels::is_between(own, corner, j)) continue;
      const T share = kernels::mean_weight<T>(j ^ o);
      kernels::unrolled<kCorners>([&](auto m) {
        if (kernels::is_between(o, j, m)) weight[m] += share;
      });
    }
  }
};

}  // namespace kerf::gpu
