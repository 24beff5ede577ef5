// SPDX-License-Identifier: MIT
//
// The cell matrices of a stored level in the basis of modes (kernels/mode_coarsen.hpp), eight cells
// side by side.
//
// Layout  [group][entry][lane]. A group without translations stores the first 231 entries alone.
// Codes   Products with stored matrices cost the bytes of their entries. In single precision those
//         of level 1 are 16-bit integers, multiples of one number a cell: the greatest entry over
//         32767. So they are off by at most 1.5e-5 of it, which a preconditioner does not notice.
//         Held cells and loose ones are not coded: what supports leave of some is singular, and
//         must not turn indefinite. Nor are coarser levels, where a few fine cells in the corner of
//         a large one give entries over more orders of magnitude, and the bytes are few.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "cpu/patched_level.hpp"
#include "kernels/mode_coarsen.hpp"

namespace kerf::cpu {

/// Eight integers as scalars.
inline Pack<float> widened(const std::int16_t* from) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m128i codes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  return Pack<float>::Vector(_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(codes)));
#else
  Pack<float> out;
  for (int k = 0; k < 8; ++k) out.set(k, static_cast<float>(from[k]));
  return out;
#endif
}

/// The nearest integers, even ones in the middle.
inline void store_narrowed(std::int16_t* to, const Pack<float>& x) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256i codes = _mm256_cvtps_epi32(__m256(x.v));
  _mm_storeu_si128(
      reinterpret_cast<__m128i*>(to),
      _mm_packs_epi32(_mm256_castsi256_si128(codes), _mm256_extracti128_si256(codes, 1)));
#else
  for (int k = 0; k < 8; ++k) to[k] = static_cast<std::int16_t>(std::lrint(x[k]));
#endif
}

/// One entry of eight cells.
struct alignas(16) CodeLanes {
  std::int16_t at[8];
};

/// Brings some lanes of eight codes to lanes of others.
class LanePicker {
 public:
  void pick(int to, int from) {
    bytes_[2 * to] = static_cast<std::uint8_t>(2 * from);
    bytes_[2 * to + 1] = static_cast<std::uint8_t>(2 * from + 1);
  }
  /// Where it picks none, zero if this is the first, else what was there.
  void add(const std::int16_t* from, bool first, CodeLanes& to) const {
#if defined(__AVX2__) && defined(__FMA__)
    auto* out = reinterpret_cast<__m128i*>(to.at);
    const __m128i order = _mm_load_si128(reinterpret_cast<const __m128i*>(bytes_));
    const __m128i codes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
    const __m128i picked = _mm_shuffle_epi8(codes, order);
    _mm_store_si128(out, first ? picked : _mm_or_si128(picked, _mm_load_si128(out)));
#else
    for (int k = 0; k < 8; ++k) {
      if (bytes_[2 * k] != kZero)
        to.at[k] = from[bytes_[2 * k] / 2];
      else if (first)
        to.at[k] = 0;
    }
#endif
  }

 private:
  static constexpr std::uint8_t kZero = 0x80;
  alignas(16) std::uint8_t bytes_[16] = {kZero, kZero, kZero, kZero, kZero, kZero, kZero, kZero,
                                         kZero, kZero, kZero, kZero, kZero, kZero, kZero, kZero};
};

template <class S>
struct PlainEntries {
  const S* from;
  Pack<S> operator[](int entry) const { return load_pack(from + kGroup * entry); }
};
struct CodedEntries {
  const std::int16_t* from;
  Pack<float> operator[](int entry) const { return widened(from + kGroup * entry); }
};

template <class S>
class StoredMatrices {
 public:
  using P = Pack<S>;

  /// Room for the groups of a level.
  void allocate(const PatchedLevel& level, bool coded, bool with_mass) {
    begin_.clear();
    traits_.clear();
    std::size_t plain = 0, codes = 0;
    for (std::size_t g = 0; g < level.groups(); ++g) {
      const bool held = level.kind[g] >= kHeldMerged;
      const bool is_coded = coded && std::is_same_v<S, float> && !held;
      const bool full = with_mass || held;
      const bool none = level.kind[g] == kNoCells || level.kind[g] == kIdle;
      traits_.push_back(static_cast<std::uint8_t>((full ? kFull : 0) | (is_coded ? kCoded : 0) |
                                                  (none ? kNone : 0)));
      std::size_t& size = is_coded ? codes : plain;
      begin_.push_back(static_cast<std::uint32_t>(size));
      if (!none) size += full ? kernels::kEntries : kernels::kModeEntries;
    }
    plain_.resize(kGroup * plain);
    codes_.resize(kGroup * codes);
    unit_.resize(codes > 0 ? level.cell.size() : 0);
  }

  bool with_translations(std::size_t group) const { return (traits_[group] & kFull) != 0; }
  std::size_t bytes() const {
    return begin_.capacity() * sizeof(begin_[0]) + traits_.capacity() +
           plain_.capacity() * sizeof(S) + codes_.capacity() * sizeof(codes_[0]) +
           unit_.capacity() * sizeof(S);
  }

  /// Of the lanes from `first` on.
  void store(std::size_t group, int first, const P (&entries)[kernels::kEntries]) {
    const int count = entries_of(group);
    if (!is_coded(group)) {
      S* to = plain_.data() + kGroup * std::size_t{begin_[group]} + first;
      for (int e = 0; e < count; ++e) store_pack(to + kGroup * e, entries[e]);
      return;
    }
    if constexpr (std::is_same_v<S, float>) encode(group, count, entries);
  }

  /// body(entries, unit, translations): matrices are the entries times the unit; the last says in
  /// its type whether there are rows of translations.
  template <class Body>
  void read(std::size_t group, int first, const Body& body) const {
    const auto with = [&](const auto& entries, const P& unit) {
      if (with_translations(group))
        body(entries, unit, std::true_type{});
      else
        body(entries, unit, std::false_type{});
    };
    const std::size_t at = kGroup * std::size_t{begin_[group]};
    if constexpr (std::is_same_v<S, float>)
      if (is_coded(group))
        return with(CodedEntries{codes_.data() + at}, load_pack(unit_.data() + kGroup * group));
    with(PlainEntries<S>{plain_.data() + at + static_cast<std::size_t>(first)}, P(S(1)));
  }

  /// The entries of single cells, one a lane (-1: none), and zero where they are not stored.
  void gather(const std::int32_t (&lanes)[P::kLanes], P (&out)[kernels::kEntries]) const {
    int count = 0;
    if constexpr (std::is_same_v<S, float>) count = gather_codes(lanes, out);
    std::fill(out + count, out + kernels::kEntries, P(0));
    for (int k = 0; k < P::kLanes; ++k) {
      if (lanes[k] < 0) continue;
      const auto lane = static_cast<std::size_t>(lanes[k]);
      const std::size_t group = lane / kGroup;
      if ((traits_[group] & (kNone | kCoded)) != 0) continue;
      const S* from = plain_.data() + kGroup * std::size_t{begin_[group]} + lane % kGroup;
      for (int e = 0; e < entries_of(group); ++e)
        out[e].set(k, from[kGroup * static_cast<std::size_t>(e)]);
    }
  }

 private:
  static constexpr std::uint8_t kFull = 1, kCoded = 2, kNone = 4;
  bool is_coded(std::size_t group) const { return (traits_[group] & kCoded) != 0; }
  int entries_of(std::size_t group) const {
    return with_translations(group) ? kernels::kEntries : kernels::kModeEntries;
  }

  /// What gather does for lanes with codes, group by group, since cells side by side mostly have
  /// parents side by side; zero in the others. Returns how many entries it wrote.
  int gather_codes(const std::int32_t (&lanes)[P::kLanes], P (&out)[kernels::kEntries]) const {
    CodeLanes codes[kernels::kEntries];
    alignas(kPackBytes) S unit[P::kLanes] = {};
    int count = 0;
    for (int k = 0; k < P::kLanes; ++k) {
      if (lanes[k] < 0) continue;
      const std::size_t group = static_cast<std::size_t>(lanes[k]) / kGroup;
      if (!is_coded(group) || (traits_[group] & kNone) != 0) continue;
      unit[k] = unit_[static_cast<std::size_t>(lanes[k])];
      bool seen = false;  // this group came with an earlier lane
      for (int j = 0; j < k; ++j)
        seen = seen || (lanes[j] >= 0 && static_cast<std::size_t>(lanes[j]) / kGroup == group);
      if (seen) continue;
      LanePicker picker;
      for (int j = k; j < P::kLanes; ++j)
        if (lanes[j] >= 0 && static_cast<std::size_t>(lanes[j]) / kGroup == group)
          picker.pick(j, lanes[j] % kGroup);
      const std::int16_t* from = codes_.data() + kGroup * std::size_t{begin_[group]};
      const bool first = count == 0;
      count = entries_of(group);  // of all groups with codes alike
      for (int e = 0; e < count; ++e) picker.add(from + kGroup * e, first, codes[e]);
    }
    const P units = load_pack(unit);
    for (int e = 0; e < count; ++e) out[e] = units * widened(codes[e].at);
    return count;
  }

  void encode(std::size_t group, int count, const P (&entries)[kernels::kEntries]) {
    // Several at a time, since each waits for the one before.
    P sizes[4] = {P(0), P(0), P(0), P(0)};
    int done = 0;
    for (; done + 4 <= count; done += 4)
      for (int k = 0; k < 4; ++k) sizes[k] = greater_size(entries[done + k], sizes[k]);
    for (; done < count; ++done) sizes[0] = greater_size(entries[done], sizes[0]);
    const P greatest =
        greater_size(greater_size(sizes[0], sizes[1]), greater_size(sizes[2], sizes[3]));
    const P none = P(S(1e-30));
    const P unit = select(greatest > none, greatest, none) * P(S(1) / S(32767));
    const P inverse = P(S(1)) / unit;
    store_pack(unit_.data() + kGroup * group, unit);
    std::int16_t* to = codes_.data() + kGroup * std::size_t{begin_[group]};
    for (int e = 0; e < count; ++e) store_narrowed(to + kGroup * e, entries[e] * inverse);
  }

  std::vector<std::uint32_t> begin_;  // per group: entries before it, in its array
  std::vector<std::uint8_t> traits_;  // per group
  std::vector<S> plain_;
  std::vector<std::int16_t> codes_;
  std::vector<S> unit_;  // per lane
};

}  // namespace kerf::cpu
