// SPDX-License-Identifier: MIT
//
// What the fast backend does within a cycle, and to vectors.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "cpu/fast_state.hpp"
#include "cpu/near_patches.hpp"
#include "cpu/surface_loops.hpp"

namespace kerf::cpu {

template <class S>
double FastBackend<S>::residual(int level) {
  settle();
  FastLevel<S>& l = levels_[level];
  const S* f = l.at(kRight);
  const S* u = l.at(kSolution);
  S* r = l.at(kResidual);
  if (l.solution_is_zero) {
    copy(level, kRight, kResidual);
    return std::sqrt(dot(level, kResidual, kResidual));
  }
  const Sums sums = sweep<S>(
      level, kNothingBefore, kNothingBefore,
      [&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u,
      [&](std::size_t group, const S* x, S* y) { add_products(level, group, x, y); },
      [&](std::size_t tile, int first, const Vec3<Pack<S>>& sum, const auto&) {
        const auto at = load_tile(f, tile, first) - masked(sum, l.fixed(tile, first));
        store_tile(r, tile, first, at);
        return Sums{dot_lanes(at, at)};
      });
  return std::sqrt(sums.first);
}

template <class S>
void FastBackend<S>::smooth(int level, SweepOrder, int count) {
  for (int i = 0; i < count; ++i) chebyshev(level);
}

/// Steps of damped Jacobi whose product is the polynomial of Chebyshev: the inverses of its roots.
/// Those of the largest and the smallest in turn, so that what rounding leaves of one is not blown
/// up by many.
struct ChebyshevSteps {
  double lower, upper;
  int degree;

  double operator[](int n) const {
    const int root = n % 2 == 0 ? n / 2 : degree - 1 - n / 2;
    return 2 /
           (upper + lower + (upper - lower) * std::cos(std::numbers::pi * (root + 0.5) / degree));
  }
};

/// One step, from value(tile, first lane): u as it was before it. `put`: shared vertices have it
/// put first, since it is not in u.
template <class S>
template <class Value>
void FastBackend<S>::chebyshev_step(int level, const Value& value, double step, bool put) {
  using V = Vec3<Pack<S>>;
  FastLevel<S>& l = levels_[level];
  S* u = l.at(kSolution);
  const S* f = l.at(kRight);
  const auto by = static_cast<S>(step);
  const S* correction = waiting_ == level ? levels_[level + 1].at(kSolution) : nullptr;
  const auto start = [&](std::size_t patch) {
    auto& points = transfer_here<S>();
    if (correction == nullptr) return points.reset();
    points.emplace(l.patched, patch);
    points->load(levels_[level + 1].patched, correction);
  };
  sweep<S>(
      level,
      [&](std::size_t tile) {
        if (!put) return;
        for_packs<S>([&](int first) { store_tile(u, tile, first, value(tile, first)); });
      },
      start, value, u,
      [&](std::size_t group, const S* x, S* y) { add_products(level, group, x, y); },
      [&](std::size_t tile, int first, const V& sum, const auto& before) {
        const V r = load_tile(f, tile, first) - masked(sum, l.fixed(tile, first));
        store_tile(u, tile, first,
                   before() + Pack<S>(by) * l.inverse_diagonals.times(tile, first, r));
        return Sums{};
      });
}

// Chebyshev acceleration of block Jacobi on [smallest, 1] * bound, as steps by the inverses of the
// roots of its polynomial: the recursion would carry a direction through memory. Residual and
// update of a vertex in one pass behind the sum of what its cells add. From a zero guess the first
// step needs no product: it is made on the fly where the second one reads it. A correction that
// waits is added there too.
// Source  Adams, Brezina, Hu, Tuminaro 2003 [ABHT03]; Saad 2003, section 12.3.
template <class S>
void FastBackend<S>::chebyshev(int level) {
  if (waiting_ != level) settle();
  FastLevel<S>& l = levels_[level];
  const int degree = smoother_.degree;
  const ChebyshevSteps steps{smoother_.smallest * l.bound, l.bound, degree};
  S* u = l.at(kSolution);
  const S* f = l.at(kRight);
  const auto first_step = static_cast<S>(steps[0]);
  const auto from_zero = [&](std::size_t tile, int first) {
    return Pack<S>(first_step) * l.inverse_diagonals.times(tile, first, load_tile(f, tile, first));
  };
  const auto corrected = [&](std::size_t tile, int first) {
    return load_tile(static_cast<const S*>(u), tile, first) +
           masked(transfer_here<S>()->taken(tile, first), l.fixed(tile, first));
  };
  const auto as_it_is = [&](std::size_t tile, int first) {
    return load_tile(static_cast<const S*>(u), tile, first);
  };
  int done = 1;
  if (l.solution_is_zero && degree == 1) {
    for_tiles(0, l.tiles(), [&](std::size_t tile) {
      for_packs<S>([&](int first) { store_tile(u, tile, first, from_zero(tile, first)); });
    });
  } else if (l.solution_is_zero) {
    chebyshev_step(level, from_zero, steps[1], true);
    done = 2;
  } else if (waiting_ == level) {
    correct_shared(level);
    chebyshev_step(level, corrected, steps[0], false);
  } else {
    chebyshev_step(level, as_it_is, steps[0], false);
  }
  waiting_ = -1;
  l.solution_is_zero = false;
  for (; done < degree; ++done) chebyshev_step(level, as_it_is, steps[done], false);
}

template <class S>
void FastBackend<S>::restrict_residual(int fine) {
  settle();
  restrict_vector(fine, kResidual);
}

template <class S>
void FastBackend<S>::restrict_vector(int fine, int x) {
  FastLevel<S>& from = levels_[fine];
  const S* r = from.at(x);
  S* const given = partial_sums<S>(4 * from.patched.transfer.point.size());
  for_patches_of(fine, [&](std::size_t patch) {
    TransferPoints<S> points(from.patched, patch);
    points.clear(given);
    points.give_own(r, given);
    points.give_leads(r, scalar_of, given);
  });
  sum_given(fine, given);
}

// What own vertices have left goes to the next level while it is in registers, and to no vector;
// that of shared ones has to wait for all patches, tile by tile behind what is given. In the order
// of restrict_residual: the same bits.
template <class S>
void FastBackend<S>::restrict_from_solution(int fine) {
  settle();
  FastLevel<S>& l = levels_[fine];
  if (l.solution_is_zero) return restrict_vector(fine, kRight);
  const S* f = l.at(kRight);
  const S* u = l.at(kSolution);
  const PatchedLevel& packed = l.patched;
  const std::size_t copies = 4 * packed.copy_point.size(), gives = 4 * packed.transfer.point.size();
  S* const given =
      partial_sums<S>(copies + gives + kTileScalars * packed.shared_tiles.size()) + copies;
  S* const shared = given + gives;
  const auto place = [&](std::int32_t v) { return scalar_of(packed.shared_number(v)); };
  const auto left = [&](std::size_t tile, int first, const Vec3<Pack<S>>& sum) {
    return load_tile(f, tile, first) - masked(sum, l.fixed(tile, first));
  };
  sweep<S>(
      fine, kNothingBefore,
      [&](std::size_t patch) {
        auto& points = transfer_here<S>();
        points.emplace(l.patched, patch);
        points->clear(given);
      },
      [&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u,
      [&](std::size_t group, const S* x, S* y) { add_products(fine, group, x, y); },
      [&](std::size_t tile, int first, const Vec3<Pack<S>>& sum, const auto&) {
        transfer_here<S>()->give_tile(tile, first, left(tile, first, sum), given);
        return Sums{};
      },
      [&](std::size_t tile, int first, const Vec3<Pack<S>>& sum, const auto&) {
        const auto number = packed.shared_number(kGroup * static_cast<std::int32_t>(tile));
        store_tile(shared, static_cast<std::size_t>(number / kGroup), first,
                   left(tile, first, sum));
        return Sums{};
      });
  for_patches_of(fine, [&](std::size_t patch) {
    TransferPoints<S>(packed, patch).give_leads(static_cast<const S*>(shared), place, given);
  });
  sum_given(fine, given);
}

/// The right-hand side of the next level, from what patches of `fine` give to its points.
template <class S>
void FastBackend<S>::sum_given(int fine, const S* given) {
  FastLevel<S>& to = levels_[fine + 1];
  const Transfer& transfer = levels_[fine].patched.transfer;
  S* f = to.at(kRight);
  const bool is_worth = levels_[fine].patched.cell.size() >= kWorthCells;
  parallel(0, to.tiles(), is_worth, [&](std::int32_t t) {
    const auto tile = static_cast<std::size_t>(t);
    for_packs<S>([&](int first) {
      alignas(kPackBytes) S sums[4 * Pack<S>::kLanes] = {};
      for (int k = 0; k < Pack<S>::kLanes; ++k)
        if (const std::int32_t v = to.patched.vertex[kGroup * tile + std::size_t(first + k)];
            v >= 0)
          sum_records<S>(transfer.givers_of(v), given, sums + 4 * k);
      store_tile(f, tile, first,
                 masked(gathered(static_cast<const S*>(sums)), to.fixed(tile, first)));
    });
  });
  zero(fine + 1, kSolution);
}

/// Corrects the vertices of a level that patches share.
template <class S>
void FastBackend<S>::correct_shared(int level) {
  FastLevel<S>& l = levels_[level];
  FastLevel<S>& next = levels_[level + 1];
  const S* from = next.at(kSolution);
  S* to = l.at(kSolution);
  for_patches_of(level, [&](std::size_t patch) {
    TransferPoints<S> points(l.patched, patch);
    points.load(next.patched, from);
    points.add_to_leads(to);
  });
}

/// The correction waits for the sweep that reads the solution next.
template <class S>
void FastBackend<S>::prolong_correction(int fine) {
  settle();
  changed(fine, kSolution);
  waiting_ = fine;
}

template <class S>
void FastBackend<S>::settle() {
  if (waiting_ < 0) return;
  const int level = waiting_;
  FastLevel<S>& l = levels_[level];
  FastLevel<S>& next = levels_[level + 1];
  correct_shared(level);
  waiting_ = -1;
  const S* from = next.at(kSolution);
  S* u = l.at(kSolution);
  for_patches_of(level, [&](std::size_t patch) {
    TransferPoints<S> points(l.patched, patch);
    points.load(next.patched, from);
    const Range& own = l.patched.patches[patch].own;
    for (std::int32_t t = own.first / kGroup; t < own.end() / kGroup; ++t) {
      const auto tile = static_cast<std::size_t>(t);
      for_packs<S>([&](int first) {
        store_tile(u, tile, first,
                   load_tile(static_cast<const S*>(u), tile, first) +
                       masked(points.taken(tile, first), l.fixed(tile, first)));
      });
    }
  });
}

template <class S>
void FastBackend<S>::solve_coarsest() {
  settle();
  FastLevel<S>& l = levels_.back();
  l.solution_is_zero = false;
  const int last = static_cast<int>(levels_.size()) - 1;
  std::vector<double> x(3 * l.patched.packed.size());
  read(last, kRight, x);
  coarsest_factor_.solve(x, threads_);
  write(last, kSolution, x);
}

template <class S>
void FastBackend<S>::precondition_jacobi(int level, int in, int out) {
  settle();
  FastLevel<S>& l = levels_[level];
  changed(level, out);
  with_types(l.vectors[in], l.vectors[out], [&](const auto* from, auto* to) {
    for_tiles(0, l.tiles(), [&](std::size_t tile) {
      for_packs<S>([&](int first) {
        store_tile_as(to, tile, first,
                      l.inverse_diagonals.times(tile, first, load_tile_as<S>(from, tile, first)));
      });
    });
  });
}

template <class S>
void FastBackend<S>::move_points(std::span<const BoundPoint> points, int displacement,
                                 std::span<Vec3d> positions) {
  settle();
  const FastLevel<S>& l = levels_[0];
  const FastVector& u = l.vectors.held(static_cast<std::size_t>(displacement));
  with_types(u, u, [&](const auto* from, const auto*) {
    const auto at = [&](std::int32_t v) {
      if (u.is_empty()) return Vec3<double>{};
      const auto* const x = from + scalar_of(l.patched.packed[v]);
      return Vec3<double>{double(x[0]), double(x[kGroup]), double(x[2 * kGroup])};
    };
    cpu::move_points(*l.patched.level, points, at, positions, threads_);
  });
}

template <class S>
void FastBackend<S>::surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                                     std::span<Vec3d> normals) {
  const std::size_t faces = surface.triangles.size();
  cpu::surface_normals(surface, positions, normals, {partial_sums<Vec3d>(faces), faces}, threads_);
}

template <class S>
void FastBackend<S>::zero(int level, int x) {
  if (waiting_ >= 0 && !(waiting_ == level && x == kSolution)) settle();
  if (waiting_ == level) waiting_ = -1;
  FastVector& vector = levels_[level].vectors.held(x);
  std::fill(vector.single.begin(), vector.single.end(), 0.0F);
  std::fill(vector.exact.begin(), vector.exact.end(), 0.0);
  if (x == kSolution) levels_[level].solution_is_zero = true;
}

template <class S>
void FastBackend<S>::copy(int level, int from, int to) {
  settle();
  changed(level, to);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[from], l.vectors[to], [&](const auto* a, auto* b) {
    using T = std::decay_t<decltype(*b)>;
    parallel(l.scalars(), kWorthScalars, [&](std::int32_t i) { b[i] = static_cast<T>(a[i]); });
  });
}

template <class S>
void FastBackend<S>::combine(int level, double a, int x, double b, int y) {
  settle();
  changed(level, y);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[y], [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    const T p = static_cast<T>(a), q = static_cast<T>(b);
    parallel(l.scalars(), kWorthScalars,
             [&](std::int32_t i) { to[i] = p * static_cast<T>(from[i]) + q * to[i]; });
  });
}

template <class S>
double FastBackend<S>::dot(int level, int x, int y) {
  settle();
  FastLevel<S>& l = levels_[level];
  double out = 0;
  with_types(l.vectors[x], l.vectors[y], [&](const auto* a, const auto* b) {
    out = sum_scalars<1>(l.scalars(), [&](std::int32_t i) {
      return std::array{static_cast<double>(a[i]) * static_cast<double>(b[i])};
    })[0];
  });
  return out;
}

template <class S>
double FastBackend<S>::true_residual(int b, int x, int r) {
  using V = Vec3<Pack<double>>;
  expects_exact(b, x);
  expects_rounded({r});
  settle();
  FastLevel<S>& l = levels_[0];
  const double *right = l.vectors[b].exact.data(), *u = l.vectors[x].exact.data();
  S* const to = l.at(r);
  const Sums sums = sweep<double>(
      0, kNothingBefore, kNothingBefore,
      [&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u,
      [&](std::size_t group, const double* in, double* out) { add_products(0, group, in, out); },
      [&](std::size_t tile, int first, const V& sum, const auto&) {
        const V at = load_tile(right, tile, first) - masked(sum, l.fixed(tile, first));
        store_tile_as(to, tile, first, at);
        return Sums{dot_lanes(at, at)};
      });
  return std::sqrt(sums.first);
}

template <class S>
std::array<double, 2> FastBackend<S>::dots(int x, int y, int z) {
  expects_rounded({x, y, z});
  settle();
  FastLevel<S>& l = levels_[0];
  const S *a = l.at(x), *b = l.at(y), *c = l.at(z);
  return sum_scalars<2>(l.scalars(), [&](std::int32_t i) {
    const auto at = static_cast<double>(a[i]);
    return std::array{at * static_cast<double>(b[i]), at * static_cast<double>(c[i])};
  });
}

// The product is that of the direction as it is stored, in double, and rounded only in the end: its
// error is then relative to itself, and does not grow with the condition of the matrix.
template <class S>
std::array<double, 2> FastBackend<S>::advance_direction(int z, double beta, int d, int q, int r) {
  using V = Vec3<Pack<double>>;
  expects_rounded({z, d, q, r});
  settle();
  FastLevel<S>& l = levels_[0];
  const S *from = l.at(z), *residual = l.at(r);
  S *to = l.at(d), *product = l.at(q);
  const auto advance = [&](std::size_t tile, int first) {
    V at = load_tile_as<double>(from, tile, first);
    if (beta != 0)
      at += Pack<double>(beta) * load_tile_as<double>(static_cast<const S*>(to), tile, first);
    return store_tile_as(to, tile, first, at);
  };
  const Sums sums = sweep<double>(
      0, [&](std::size_t tile) { for_packs<double>([&](int first) { advance(tile, first); }); },
      kNothingBefore, advance, static_cast<const S*>(to),
      [&](std::size_t group, const double* x, double* y) { add_products(0, group, x, y); },
      [&](std::size_t tile, int first, const V& sum, const auto& value) {
        const V at = value(), out = masked(sum, l.fixed(tile, first));
        store_tile_as(product, tile, first, out);
        return Sums{dot_lanes(at, out), dot_lanes(at, load_tile_as<double>(residual, tile, first))};
      });
  return {sums.first, sums.second};
}

template <class S>
double FastBackend<S>::advance_solution(double a, int d, int q, int x, int r) {
  expects_exact(x, x);
  expects_rounded({d, q, r});
  settle();
  FastLevel<S>& l = levels_[0];
  const S *direction = l.at(d), *product = l.at(q);
  double* solution = l.vectors[x].exact.data();
  S* residual = l.at(r);
  return sum_scalars<1>(l.scalars(), [&](std::int32_t i) {
    solution[i] += a * static_cast<double>(direction[i]);
    const double left = static_cast<double>(residual[i]) - a * static_cast<double>(product[i]);
    residual[i] = static_cast<S>(left);
    return std::array{left * left};
  })[0];
}

template <class S>
void FastBackend<S>::mask(int level, int x) {
  settle();
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* values) {
    for_tiles(0, l.tiles(), [&](std::size_t tile) {
      using T = std::decay_t<decltype(*values)>;
      for_packs<T>([&](int first) {
        store_tile(
            values, tile, first,
            masked(load_tile(static_cast<const T*>(values), tile, first), l.fixed(tile, first)));
      });
    });
  });
}

template <class S>
void FastBackend<S>::write(int level, int x, std::span<const double> values) {
  settle();
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.patched.packed.size(),
          "write: three values per vertex of the level");
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    for (std::size_t v = 0; v < l.patched.packed.size(); ++v)
      for (std::size_t c = 0; c < 3; ++c)
        to[scalar_of(l.patched.packed[v]) + kGroup * c] = static_cast<T>(values[3 * v + c]);
  });
}

template <class S>
void FastBackend<S>::read(int level, int x, std::span<double> values) const {
  const_cast<FastBackend*>(this)->settle();  // what was asked for before
  const FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.patched.packed.size(),
          "read: three values per vertex of the level");
  const FastVector& vector = l.vectors.held(x);
  if (vector.is_empty()) return std::fill(values.begin(), values.end(), 0.0);
  with_types(vector, vector, [&](const auto* from, const auto*) {
    for (std::size_t v = 0; v < l.patched.packed.size(); ++v)
      for (std::size_t c = 0; c < 3; ++c)
        values[3 * v + c] = from[scalar_of(l.patched.packed[v]) + kGroup * c];
  });
}

template <class S>
void FastBackend<S>::write_some(int level, int x, std::span<const std::int32_t> vertices,
                                std::span<const double> values) {
  settle();
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    for (std::size_t k = 0; k < values.size(); ++k)
      to[scalar_of(l.patched.packed[vertices[k / 3]]) + kGroup * (k % 3)] =
          static_cast<T>(values[k]);
  });
}

template <class S>
void FastBackend<S>::read_some(int level, int x, std::span<const std::int32_t> vertices,
                               std::span<double> values) const {
  const_cast<FastBackend*>(this)->settle();
  const FastLevel<S>& l = levels_[level];
  const FastVector& vector = l.vectors.held(x);
  if (vector.is_empty()) return std::fill(values.begin(), values.end(), 0.0);
  with_types(vector, vector, [&](const auto* from, const auto*) {
    for (std::size_t k = 0; k < values.size(); ++k)
      values[k] = from[scalar_of(l.patched.packed[vertices[k / 3]]) + kGroup * (k % 3)];
  });
}

template <class S>
NearCells FastBackend<S>::find_near(int displacement, const BladeReach& reach,
                                    std::span<const std::int32_t> opened) const {
  expects_exact(displacement, displacement);
  ensures(levels_[0].patched.corners_at.empty(), "cells near a blade are asked for without links");
  FastBackend& self = *const_cast<FastBackend*>(this);  // what was asked for before
  self.settle();
  return cpu::find_near(levels_[0].patched, hierarchy_->spacing,
                        self.levels_[0].vectors[displacement].exact, reach, opened, threads_);
}

template class FastBackend<float>;
template class FastBackend<double>;

}  // namespace kerf::cpu
