// SPDX-License-Identifier: MIT
//
// Entries of single cells, one a lane, from groups in which their lanes lie anywhere. Cells side by
// side mostly have children, and parents, in few groups, so whole packs are read and permuted.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "cpu/pack.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::cpu {

/// Which lanes of a pack go to which lanes of another.
struct LanePicks {
  static constexpr int kLanes = Pack<float>::kLanes;

  alignas(kPackBytes) std::int32_t from[kLanes];
  std::uint32_t to;  // bits

  void pick(int lane, int from_lane) {
    from[lane] = from_lane;
    to |= std::uint32_t{1} << lane;
  }
};

/// The same in registers.
class LanePicker {
 public:
#if KERF_PACK_BITS == 512
  explicit LanePicker(const LanePicks& picks)
      : order_(_mm512_load_si512(picks.from)), to_(static_cast<__mmask16>(picks.to)) {}
  /// The picked lanes of x; those of `other` where it picks none.
  Pack<float> operator()(const Pack<float>& x, const Pack<float>& other) const {
    return Pack<float>::Vector(
        _mm512_mask_permutexvar_ps(__m512(other.v), to_, order_, __m512(x.v)));
  }

 private:
  __m512i order_;
  __mmask16 to_;
#elif KERF_PACK_BITS == 256
  explicit LanePicker(const LanePicks& picks)
      : order_(_mm256_load_si256(reinterpret_cast<const __m256i*>(picks.from))) {
    alignas(kPackBytes) std::int32_t mask[LanePicks::kLanes];
    for (int k = 0; k < LanePicks::kLanes; ++k) mask[k] = (picks.to >> k & 1) != 0 ? -1 : 0;
    to_ = _mm256_castsi256_ps(_mm256_load_si256(reinterpret_cast<const __m256i*>(mask)));
  }
  /// The picked lanes of x; those of `other` where it picks none.
  Pack<float> operator()(const Pack<float>& x, const Pack<float>& other) const {
    const __m256 picked = _mm256_permutevar8x32_ps(__m256(x.v), order_);
    return Pack<float>::Vector(_mm256_blendv_ps(__m256(other.v), picked, to_));
  }

 private:
  __m256i order_;
  __m256 to_;
#else
  explicit LanePicker(const LanePicks& picks) : picks_(picks) {}
  /// The picked lanes of x; those of `other` where it picks none.
  Pack<float> operator()(const Pack<float>& x, const Pack<float>& other) const {
    Pack<float> out = other;
    for (int k = 0; k < LanePicks::kLanes; ++k)
      if ((picks_.to >> k & 1) != 0) out.set(k, x[picks_.from[k]]);
    return out;
  }

 private:
  LanePicks picks_;
#endif
};

/// Where the entries of the cells in some lanes of a pack are. T: what an entry is stored as; those
/// of a group lie behind each other, the lanes of each side by side.
template <class T>
class LaneSources {
 public:
  static constexpr int kStride = 16;  // lanes of a group

  bool empty() const { return size_ == 0; }

  /// `group`: the first entry of its first lane.
  void add(int lane, const T* group, int lane_of_group) {
    constexpr int kLanes = LanePicks::kLanes;
    const T* const piece = group + lane_of_group / kLanes * kLanes;
    const auto n = static_cast<int>(std::find(from_, from_ + size_, piece) - from_);
    if (n == size_) {
      from_[size_] = piece;
      picks_[size_++] = LanePicks{};
    }
    picks_[n].pick(lane, lane_of_group % kLanes);
  }

  /// out[e] = scale times entry e, or more of it if `more`, for e from `begin` on; widen(const T*)
  /// makes a pack. Zero in other lanes.
  template <class Widen>
  void gather(int begin, int end, const Widen& widen, const Pack<float>& scale, bool more,
              Pack<float>* out) const {
    constexpr int kMost = 4;  // in registers
    for (int first = 0; first < size_; first += kMost, more = true)
      with_count(std::min(kMost, size_ - first), [&](auto count) {
        if (more)
          gather_some<decltype(count)::value, true>(first, begin, end, widen, scale, out);
        else
          gather_some<decltype(count)::value, false>(first, begin, end, widen, scale, out);
      });
  }

 private:
  template <class Body>
  static void with_count(int count, const Body& body) {
    kernels::unrolled<4>([&](auto n) {
      if (count == n + 1) body(kernels::Constant<n + 1>{});
    });
  }

  template <int count, bool more, class Widen>
  void gather_some(int first, int begin, int end, const Widen& widen, const Pack<float>& scale,
                   Pack<float>* out) const {
    const auto at = [&](int n) { return std::min(first + n, size_ - 1); };
    const LanePicker pick[4] = {LanePicker(picks_[at(0)]), LanePicker(picks_[at(1)]),
                                LanePicker(picks_[at(2)]), LanePicker(picks_[at(3)])};
    const T* const from[4] = {from_[at(0)], from_[at(1)], from_[at(2)], from_[at(3)]};
    for (int e = begin; e < end; ++e) {
      const std::ptrdiff_t entry = std::ptrdiff_t{kStride} * e;
      Pack<float> picked(0);
      kernels::unrolled<count>([&](auto n) { picked = pick[n](widen(from[n] + entry), picked); });
      if constexpr (more)
        out[e] += scale * picked;
      else
        out[e] = scale * picked;
    }
  }

  const T* from_[LanePicks::kLanes];
  LanePicks picks_[LanePicks::kLanes];
  int size_ = 0;
};

}  // namespace kerf::cpu
