// SPDX-License-Identifier: MIT
//
// What the fast backend does within a cycle, and to vectors.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cpu/fast_state.hpp"
#include "cpu/surface_loops.hpp"

namespace kerf::cpu {

template <class S>
double FastBackend<S>::residual(int level) {
  FastLevel<S>& l = levels_[level];
  const S* f = l.at(kRight);
  S* r = l.at(kResidual);
  const S* all = l.solution_is_zero ? nullptr : products<S>(level, scale_, l.at(kSolution));
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    Vec3<S> at = load_vertex(f, v);
    if (all != nullptr) at -= masked(sum_records(l.packed, all, v), l.fixed(v));
    store(r, v, at);
  });
  return std::sqrt(dot_typed(r, r, 3 * l.vertices()));
}

template <class S>
void FastBackend<S>::smooth(int level, SweepOrder, int count) {
  for (int i = 0; i < count; ++i) chebyshev(level);
}

// Chebyshev acceleration of block Jacobi on [smallest, 1] * bound; residual, direction and update
// of a vertex in one pass behind the sum of its records.
// Source  Adams, Brezina, Hu, Tuminaro 2003 [ABHT03]; Saad 2003, algorithm 12.1.
template <class S>
void FastBackend<S>::chebyshev(int level) {
  FastLevel<S>& l = levels_[level];
  const double upper = l.bound, lower = smoother_.smallest * upper;
  const double theta = 0.5 * (upper + lower), delta = 0.5 * (upper - lower);
  const double sigma = theta / delta;
  double rho = 1 / sigma;
  S *u = l.at(kSolution), *d = l.at(kDirection);
  const S* f = l.at(kRight);
  for (int step = 0; step < smoother_.degree; ++step) {
    const double next = step == 0 ? rho : 1 / (2 * sigma - rho);
    const S keep = static_cast<S>(step == 0 ? 0 : next * rho);
    const S take = static_cast<S>(step == 0 ? 1 / theta : 2 * next / delta);
    rho = next;
    const S* all = l.solution_is_zero ? nullptr : products<S>(level, scale_, u);
    l.solution_is_zero = false;
    parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
      Vec3<S> r = load_vertex(f, v), before{};
      if (all != nullptr) {
        r -= masked(sum_records(l.packed, all, v), l.fixed(v));
        before = load_vertex(u, v);
      }
      const S* b = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
      Vec3<S> direction = take * (kernels::Sym3<S>{b[0], b[1], b[2], b[3], b[4], b[5]} * r);
      if (step > 0) direction += keep * load_vertex(d, v);
      store(d, v, direction);
      store(u, v, before + direction);
    });
  }
}

template <class S>
void FastBackend<S>::restrict_residual(int fine) {
  const FastLevel<S>& from = levels_[fine];
  FastLevel<S>& to = levels_[fine + 1];
  const SparseWeights& rows = from.packed.restrict_;
  const S* r = levels_[fine].at(kResidual);
  S* f = to.at(kRight);
  parallel(to.vertices(), kWorthVertices / 8, [&](std::int32_t v) {
    Vec3<S> sum{};
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k)
      sum += static_cast<S>(rows.weight[k]) * load_vertex(r, rows.vertex[k]);
    store(f, v, masked(sum, to.fixed(v)));
  });
  zero(fine + 1, kSolution);
}

template <class S>
void FastBackend<S>::prolong_correction(int fine) {
  FastLevel<S>& to = levels_[fine];
  const SparseWeights& rows = to.packed.prolong;
  const S* coarse = levels_[fine + 1].at(kSolution);
  changed(fine, kSolution);
  S* u = to.at(kSolution);
  parallel(to.vertices(), kWorthVertices, [&](std::int32_t v) {
    Vec3<S> sum{};
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k)
      sum += static_cast<S>(rows.weight[k]) * load_vertex(coarse, rows.vertex[k]);
    store(u, v, load_vertex(u, v) + masked(sum, to.fixed(v)));
  });
}

template <class S>
void FastBackend<S>::solve_coarsest() {
  FastLevel<S>& l = levels_.back();
  l.solution_is_zero = false;
  const std::size_t size = 3 * l.packed.vertices();
  std::vector<double> right(size), solution(size);
  std::copy_n(l.at(kRight), size, right.begin());
  coarsest_factor_.solve(right, solution);
  for (std::size_t i = 0; i < size; ++i) l.at(kSolution)[i] = static_cast<S>(solution[i]);
}

template <class S>
void FastBackend<S>::precondition_jacobi(int level, int in, int out) {
  FastLevel<S>& l = levels_[level];
  changed(level, out);
  with_types(l.vectors[in], l.vectors[out], [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
      const S* b = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
      const auto at = load_vertex(from, v);
      const Vec3<S> r{static_cast<S>(at.x), static_cast<S>(at.y), static_cast<S>(at.z)};
      const Vec3<S> z = kernels::Sym3<S>{b[0], b[1], b[2], b[3], b[4], b[5]} * r;
      store(to, v, Vec3<T>{static_cast<T>(z.x), static_cast<T>(z.y), static_cast<T>(z.z)});
    });
  });
}

template <class S>
void FastBackend<S>::move_points(std::span<const BoundPoint> points, int displacement,
                                 std::span<Vec3d> positions) {
  cpu::move_points(*levels_[0].packed.level, points, levels_[0].vectors[displacement].exact.data(),
                   positions, threads_);
}

template <class S>
void FastBackend<S>::surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                                     std::span<Vec3d> normals) {
  cpu::surface_normals(surface, positions, normals, faces_, threads_);
}

template <class S>
void FastBackend<S>::zero(int level, int x) {
  FastVector& vector = levels_[level].vectors[x];
  std::fill(vector.single.begin(), vector.single.end(), 0.0F);
  std::fill(vector.exact.begin(), vector.exact.end(), 0.0);
  if (x == kSolution) levels_[level].solution_is_zero = true;
}

template <class S>
void FastBackend<S>::copy(int level, int from, int to) {
  changed(level, to);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[from], l.vectors[to], [&](const auto* a, auto* b) {
    using T = std::decay_t<decltype(*b)>;
    parallel(3 * l.vertices(), kWorthScalars, [&](std::int32_t i) { b[i] = static_cast<T>(a[i]); });
  });
}

template <class S>
void FastBackend<S>::combine(int level, double a, int x, double b, int y) {
  changed(level, y);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[y], [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    const T p = static_cast<T>(a), q = static_cast<T>(b);
    parallel(3 * l.vertices(), kWorthScalars,
             [&](std::int32_t i) { to[i] = p * static_cast<T>(from[i]) + q * to[i]; });
  });
}

// Fixed chunks, summed in their order, eight sums side by side in each: the same bits for any
// number of threads.
template <class S>
double FastBackend<S>::dot(int level, int x, int y) {
  FastLevel<S>& l = levels_[level];
  double out = 0;
  with_types(l.vectors[x], l.vectors[y],
             [&](const auto* a, const auto* b) { out = dot_typed(a, b, 3 * l.vertices()); });
  return out;
}

template <class S>
void FastBackend<S>::mask(int level, int x) {
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* values) {
    parallel(l.vertices(), kWorthVertices,
             [&](std::int32_t v) { store(values, v, masked(load_vertex(values, v), l.fixed(v))); });
  });
}

template <class S>
void FastBackend<S>::write(int level, int x, std::span<const double> values) {
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.packed.vertices(), "write: three values per vertex of the level");
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    for (std::size_t i = 0; i < values.size(); ++i) to[i] = static_cast<T>(values[i]);
  });
}

template <class S>
void FastBackend<S>::read(int level, int x, std::span<double> values) const {
  const FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.packed.vertices(), "read: three values per vertex of the level");
  with_types(l.vectors[x], l.vectors[x], [&](const auto* from, const auto*) {
    std::copy_n(from, values.size(), values.begin());
  });
}

template class FastBackend<float>;
template class FastBackend<double>;

}  // namespace kerf::cpu
