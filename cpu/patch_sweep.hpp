// SPDX-License-Identifier: MIT
//
// Products with the matrices of a patch, from vectors to vectors: copies the points of the patch,
// lets the cells add to them, and hands each vertex its sum while it is in registers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <new>
#include <vector>

#include "cpu/patched_level.hpp"

namespace kerf::cpu {

/// Scalars of the points of one patch, aligned for whole packs. Grows, never shrinks.
template <class S>
class PointBuffer {
 public:
  PointBuffer() = default;
  PointBuffer(const PointBuffer&) = delete;
  PointBuffer& operator=(const PointBuffer&) = delete;
  ~PointBuffer() { ::operator delete(data_, kAlign); }

  S* reserve(std::size_t scalars) {
    if (scalars <= size_) return data_;
    ::operator delete(data_, kAlign);
    data_ = nullptr;
    size_ = 0;
    data_ = static_cast<S*>(::operator new(scalars * sizeof(S), kAlign));
    size_ = scalars;
    return data_;
  }

 private:
  static constexpr std::align_val_t kAlign{64};
  S* data_ = nullptr;
  std::size_t size_ = 0;
};

template <class S>
Pack<S> tile_pack(const S* x, std::size_t tile, int component, int first) {
  return load_pack(x + kTileScalars * tile + kGroup * component + first);
}

/// Asks for what a pass over tiles needs a few of them later: `scalars` of a vertex.
template <bool to_write = false, class S>
void prefetch_tile(const S* x, std::size_t tile, std::size_t scalars) {
  constexpr std::size_t kAhead = 8;
  const std::size_t size = kGroup * scalars;
  prefetch<to_write>(x, size * (tile + kAhead), size);
}

/// The vectors of a tile, of the lanes from `first` on.
template <class S>
kernels::Vec3<Pack<S>> load_tile(const S* x, std::size_t tile, int first) {
  if (first == 0) prefetch_tile(x, tile, 3);
  return {tile_pack(x, tile, 0, first), tile_pack(x, tile, 1, first), tile_pack(x, tile, 2, first)};
}
/// The same from a vector of any precision.
template <class S, class From>
kernels::Vec3<Pack<S>> load_tile_as(const From* x, std::size_t tile, int first) {
  if (first == 0) prefetch_tile(x, tile, 3);
  kernels::Vec3<Pack<S>> out;
  for (int c = 0; c < 3; ++c)
    out[c] = load_pack_as<S>(x + kTileScalars * tile + kGroup * c + first);
  return out;
}

/// To a vector of any precision; returns what is there now.
template <class To, class S>
kernels::Vec3<Pack<S>> store_tile_as(To* x, std::size_t tile, int first, kernels::Vec3<Pack<S>> v) {
  if (first == 0) prefetch_tile<true>(static_cast<const To*>(x), tile, 3);
  for (int c = 0; c < 3; ++c)
    v[c] = store_pack_as(x + kTileScalars * tile + kGroup * c + first, v[c]);
  return v;
}

template <class S>
void store_tile(S* x, std::size_t tile, int first, const kernels::Vec3<Pack<S>>& v) {
  if (first == 0) prefetch_tile<true>(static_cast<const S*>(x), tile, 3);
  S* to = x + kTileScalars * tile + first;
  store_pack(to, v.x);
  store_pack(to + kGroup, v.y);
  store_pack(to + 2 * kGroup, v.z);
}

/// The sum of all lanes in double: of both halves, of halves of that, and so on.
template <class S, int kBytes>
double sum_lanes(const Pack<S, kBytes>& pack) {
  constexpr int kLanes = Pack<S, kBytes>::kLanes;
  double sums[kLanes];
  for (int k = 0; k < kLanes; ++k) sums[k] = static_cast<double>(pack[k]);
  for (int count = kLanes / 2; count > 0; count /= 2)
    for (int k = 0; k < count; ++k) sums[k] += sums[k + count];
  return sums[0];
}
template <class S>
double dot_lanes(const kernels::Vec3<Pack<S>>& a, const kernels::Vec3<Pack<S>>& b) {
  return sum_lanes(fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)));
}

/// What a pass over vertices sums beside its work.
struct Sums {
  double first = 0, second = 0;

  Sums& operator+=(const Sums& b) {
    first += b.first;
    second += b.second;
    return *this;
  }
};

/// Zero where a component is held.
template <class S>
kernels::Vec3<Pack<S>> masked(kernels::Vec3<Pack<S>> v, const std::uint8_t* fixed) {
  std::uint64_t any[2] = {};
  static_assert(Pack<S>::kLanes <= sizeof any);
  std::memcpy(any, fixed, Pack<S>::kLanes);
  if ((any[0] | any[1]) == 0) return v;
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    for (int c = 0; c < 3; ++c)
      if ((fixed[k] >> c) & 1) v[c].set(k, S(0));
  return v;
}

/// Calls body(first lane) for each pack of a group.
template <class S, class Body>
void for_packs(const Body& body) {
  for (int first = 0; first < kGroup; first += Pack<S>::kLanes) body(first);
}

/// The sum of some of many records, in their order.
template <class S>
void sum_records(std::span<const std::int32_t> which, const S* records, S* out) {
  typename Record<S>::Vector sum{}, one;
  for (const std::int32_t n : which) {
    __builtin_memcpy(&one, records + 4 * std::size_t(n), sizeof one);
    sum += one;
  }
  __builtin_memcpy(out, &sum, sizeof sum);
}

/// The points of one patch: x, which the cells read, and y, to which they add.
template <class S>
class PatchPoints {
 public:
  using P = Pack<S>;

  PatchPoints(const PatchedLevel& level, const Patch& patch) : level_(level), patch_(patch) {
    thread_local PointBuffer<S> x;
    x_ = x.reserve(4 * static_cast<std::size_t>(patch.points));
  }

  const S* x() const { return x_; }
  S* y() const { return y_; }

  /// own(tile, first lane): the vectors of vertices of this patch alone; shared vertices from u.
  template <class Own, class From>
  void load(const Own& own, const From* u) {
    for (std::size_t at = first_tile(); at < end_tile(); ++at)
      for_packs<S>([&](int first) { put_points(x_, own_points(at, first), own(at, first)); });
    load_copies(u);
    interpolate_hanging();
    std::fill_n(x_ + 4 * std::size_t(kNothing), 4 * kNothings, S(0));
  }
  /// Zero in y, which is not there before.
  void start_sums() {
    thread_local PointBuffer<S> y;
    const std::size_t scalars = 4 * static_cast<std::size_t>(patch_.points);
    y_ = y.reserve(scalars);
    std::fill_n(y_, scalars, S(0));
  }

  /// finish(tile, first lane, sum, value): what the cells added to vertices of this patch alone,
  /// and a function for the x they had; shared vertices to `partial`, by copy. Returns the sum of
  /// what finish returns, in a fixed order.
  template <class Finish>
  Sums store(const Finish& finish, S* partial) {
    gather_hanging();
    Sums sum;
    for (std::size_t at = first_tile(); at < end_tile(); ++at)
      for_packs<S>([&](int first) {
        const std::uint16_t* points = own_points(at, first);
        sum += finish(at, first, gathered(y_, points),
                      [&] { return gathered(static_cast<const S*>(x_), points); });
      });
    for (std::int32_t k = patch_.copies.first; k < patch_.copies.end(); ++k)
      std::memcpy(partial + 4 * std::size_t(k), y_ + 4 * std::size_t(level_.copy_point[k]),
                  4 * sizeof(S));
    return sum;
  }

 private:
  using R = typename Record<S>::Vector;
  // By reference, since a vector that is returned has another place on machines without AVX.
  static void read(const S* x, std::size_t point, R& out) {
    __builtin_memcpy(&out, x + 4 * point, sizeof out);
  }
  static void write(S* x, std::size_t point, const R& r) {
    __builtin_memcpy(x + 4 * point, &r, sizeof r);
  }
  std::size_t first_tile() const { return static_cast<std::size_t>(patch_.own.first / kGroup); }
  std::size_t end_tile() const { return static_cast<std::size_t>(patch_.own.end() / kGroup); }
  const std::uint16_t* own_points(std::size_t tile, int first) const {
    return level_.own_point.data() + kGroup * tile + first;
  }

  // A function of its own: transfer_points.hpp says why.
  template <class From>
  [[gnu::noinline]] void load_copies(const From* u) {
    const std::int32_t* const vertex = level_.copy_vertex.data();
    const std::uint16_t* const point = level_.copy_point.data();
    for (std::int32_t k = patch_.copies.first, end = patch_.copies.end(); k < end; ++k) {
      const From* from = u + scalar_of(vertex[k]);
      S* to = x_ + 4 * std::size_t(point[k]);
      to[0] = static_cast<S>(from[0]);
      to[1] = static_cast<S>(from[kGroup]);
      to[2] = static_cast<S>(from[2 * kGroup]);
      to[3] = 0;
    }
  }

  void interpolate_hanging() {
    const auto* const masters_of = level_.hanging_masters.data();  // not read again for each write
    const std::uint16_t* const points = level_.hanging_point.data();
    for (std::int32_t h = patch_.hanging.first, end = patch_.hanging.end(); h < end; ++h) {
      const auto& masters = masters_of[h];
      const std::uint16_t point = points[h];
      R of[4];
      read(x_, masters[0], of[0]);
      read(x_, masters[2], of[2]);
      if (is_on_edge(masters)) {
        write(x_, point, S(0.5) * (of[0] + of[2]));
        continue;
      }
      read(x_, masters[1], of[1]);
      read(x_, masters[3], of[3]);
      write(x_, point, S(0.25) * ((of[0] + of[1]) + (of[2] + of[3])));
    }
  }
  void gather_hanging() {
    const auto add = [&](std::uint16_t point, const R& share) {
      R sum;
      read(y_, point, sum);
      write(y_, point, sum + share);
    };
    const auto* const masters_of = level_.hanging_masters.data();
    const std::uint16_t* const points = level_.hanging_point.data();
    for (std::int32_t h = patch_.hanging.first, end = patch_.hanging.end(); h < end; ++h) {
      const auto& masters = masters_of[h];
      R sum;
      read(y_, points[h], sum);
      if (is_on_edge(masters)) {
        for (std::size_t k = 0; k < 4; k += 2) add(masters[k], S(0.5) * sum);
      } else {
        for (const std::uint16_t m : masters) add(m, S(0.25) * sum);
      }
    }
  }

  const PatchedLevel& level_;
  const Patch& patch_;
  S* x_;
  S* y_ = nullptr;
};

/// The sums of the n-th tile of shared vertices over their copies, of the lanes from `first` on.
template <class S>
kernels::Vec3<Pack<S>> shared_sums(const PatchedLevel& level, std::int32_t n, int first,
                                   const S* partial) {
  alignas(kPackBytes) S sums[4 * Pack<S>::kLanes] = {};
  const std::int32_t begin = kGroup * n + first;
  for (int k = 0; k < Pack<S>::kLanes && begin + k < level.shared; ++k)
    sum_records(level.copies(begin + k), partial, sums + 4 * k);
  return gathered(static_cast<const S*>(sums));
}

}  // namespace kerf::cpu
