// SPDX-License-Identifier: MIT
//
// The cell matrices of a stored level in the basis of modes (kernels/mode_coarsen.hpp), the
// cells of a group side by side.
//
// Layout  [group][entry][lane]. A group without translations stores the first 231 entries alone.
// Turned  A group has rotations where its matrices are R A R^T: products turn what they read and
//         write, A is stored without rotation, and stays as it is while cells turn. Nothing but the
//         rotations is stored of cells that are one element each: those of level 0 that are passed
//         on, and where the backend says so, eight elements as one.
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
#include <utility>
#include <vector>

#include "core/base/array.hpp"
#include "cpu/codes.hpp"
#include "cpu/lane_picker.hpp"
#include "cpu/patched_level.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/rotation.hpp"

namespace kerf::cpu {

/// Rotations of a group, [w x y z][lane], of the lanes that a pack has.
template <class S>
kernels::Quat<Pack<S>> load_quaternion(const S* q) {
  return {load_pack(q), load_pack(q + kGroup), load_pack(q + 2 * kGroup),
          load_pack(q + 3 * kGroup)};
}
template <class S>
void store_quaternion(S* to, const kernels::Quat<Pack<S>>& q) {
  store_pack(to, q.w);
  store_pack(to + kGroup, q.x);
  store_pack(to + 2 * kGroup, q.y);
  store_pack(to + 3 * kGroup, q.z);
}

/// Entries of a group as packs. Each read asks memory for what lies a group or somewhat more ahead:
/// all of it at once, before the product, gained nothing.
template <class S>
struct PlainEntries {
  const S* from;
  Pack<S> operator[](int entry) const {
    prefetch(from, kGroup * static_cast<std::size_t>(entry + kernels::kModeEntries),
             Pack<S>::kLanes);
    return load_pack(from + kGroup * entry);
  }
};
struct CodedEntries {
  const std::int16_t* from;
  Pack<float> operator[](int entry) const {
    constexpr int kAhead = 4 * kernels::kModeEntries / 3;
    if (entry % 2 == 0) prefetch(from, kGroup * static_cast<std::size_t>(entry + kAhead), 1);
    return widened(from + kGroup * entry);
  }
};

static_assert(LaneSources<float>::kStride == kGroup);

template <class S>
class StoredMatrices {
 public:
  using P = Pack<S>;

  /// What the groups of a level are, with room for rotations; all that may be elements are, and
  /// all that may be turned: elements alone, or any.
  void start(const PatchedLevel& level, bool coded, bool with_mass, bool any_turned) {
    any_turned_ = any_turned;
    traits_.resize(level.groups());
    known_.resize(level.groups());
    rotations_at_.clear();
    std::uint32_t rotations = 0;
    for (std::size_t g = 0; g < level.groups(); ++g) {
      const bool held = is_held(level.kind[g]), element = is_of_finest(level.kind[g]);
      const bool none = level.kind[g] == kNoCells || level.kind[g] == kIdle;
      const bool turned = element || (any_turned && !none);
      const bool is_coded = coded && std::is_same_v<S, float> && !held;
      const auto traits = static_cast<std::uint8_t>(
          (with_mass || held ? kFull : 0) | (is_coded ? kCoded : 0) | (none ? kNone : 0) |
          (element ? kMayBeElement | kElement : 0) | (turned ? kTurned : 0));
      constexpr int kLayout = kFull | kCoded | kNone | kMayBeElement;
      if (((traits ^ traits_[g]) & kLayout) != 0) known_[g] = Known::no;
      traits_[g] = traits;
      rotations_at_.push_back(rotations);
      rotations += turned ? 1 : 0;
    }
    rotations_.resize(4 * kGroup * std::size_t{rotations});
  }
  /// A group that is no element, or not to be turned either.
  void store_matrices(std::size_t group) {
    clear(group, any_turned_ ? kElement : kElement | kTurned);
  }
  void do_not_turn(std::size_t group) {
    clear(group, kElement | kTurned);
    if (known_[group] == Known::yes) known_[group] = Known::no;
  }
  /// Room for the matrices of all groups that are no elements. Those that may be lie behind all
  /// others, so that these stay where they are while cells turn.
  void allocate() {
    std::vector<std::uint32_t> begin(traits_.size());
    std::size_t plain = 0, codes = 0;
    bool any_known = false, moved = false;
    for (const int may_be : {0, int{kMayBeElement}})
      for (std::size_t g = 0; g < traits_.size(); ++g) {
        if ((traits_[g] & kMayBeElement) != may_be) continue;
        std::size_t& size = is_coded(g) ? codes : plain;
        begin[g] = static_cast<std::uint32_t>(size);
        if (is_stored(g)) size += static_cast<std::size_t>(entries_of(g));
        if (!knows_unrotated(g)) continue;
        any_known = true;
        moved = moved || begin[g] != begin_[g];
      }
    if (moved) {
      move_known(plain_, kGroup * plain, false, begin);
      move_known(codes_, kGroup * codes, true, begin);
    } else {
      make_room(plain_, kGroup * plain, any_known);
      make_room(codes_, kGroup * codes, any_known);
    }
    unit_.resize(codes > 0 ? kGroup * traits_.size() : 0);
    begin_ = std::move(begin);
  }

  bool is_turned(std::size_t group) const { return (traits_[group] & kTurned) != 0; }
  bool is_element(std::size_t group) const { return (traits_[group] & kElement) != 0; }

  /// Whether what is stored of a group is its matrix without rotation, and still right.
  bool knows_unrotated(std::size_t group) const {
    return known_[group] == Known::yes && is_stored(group);
  }
  void know_unrotated(std::size_t group) { known_[group] = Known::yes; }
  /// Whether a group cannot be turned at all, whatever its rotations.
  bool never_turns(std::size_t group) const { return known_[group] == Known::never; }
  void never_turn(std::size_t group) { known_[group] = Known::never; }
  /// What is stored of one, or all, is not right any more.
  void forget_unrotated(std::size_t group) {
    if (group < known_.size()) known_[group] = Known::no;
  }
  void forget_unrotated() { std::fill(known_.begin(), known_.end(), Known::no); }

  void store(std::size_t group, int first, const kernels::Quat<P>& q) {
    store_quaternion(rotations_.data() + rotations_of(group) + first, q);
  }
  kernels::Quat<P> rotation(std::size_t group, int first) const {
    constexpr std::size_t kAhead = 4, kScalars = 4 * kGroup;
    prefetch(rotations_.data(), rotations_of(group) + kScalars * kAhead, kScalars);
    return load_quaternion(rotations_.data() + rotations_of(group) + first);
  }
  /// w of a cell in a group that is turned; the others follow in steps of a group.
  const S* rotation_of(std::size_t lane) const {
    return rotations_.data() + rotations_of(lane / kGroup) + lane % kGroup;
  }

  bool with_translations(std::size_t group) const { return (traits_[group] & kFull) != 0; }
  std::size_t bytes() const {
    return bytes_of(begin_) + bytes_of(rotations_at_) + bytes_of(traits_) + bytes_of(known_) +
           bytes_of(rotations_) + bytes_of(plain_) + bytes_of(codes_) + bytes_of(unit_);
  }

  /// Of the lanes from `first` on.
  void store(std::size_t group, int first, const P (&entries)[kernels::kEntries]) {
    const int count = entries_of(group);
    if (!is_coded(group)) {
      S* to = plain_.data() + kGroup * std::size_t{begin_[group]} + first;
      for (int e = 0; e < count; ++e) store_pack(to + kGroup * e, entries[e]);
      return;
    }
    if constexpr (std::is_same_v<S, float>) encode(group, first, count, entries);
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
        return with(CodedEntries{codes_.data() + at + first},
                    load_pack(unit_.data() + kGroup * group + static_cast<std::size_t>(first)));
    with(PlainEntries<S>{plain_.data() + at + static_cast<std::size_t>(first)}, P(S(1)));
  }

  /// The entries of single cells as they are stored, one a lane (-1: none), and zero where they are
  /// not or the cell is an element.
  void gather(const std::int32_t (&lanes)[P::kLanes], P (&out)[kernels::kEntries]) const {
    if constexpr (std::is_same_v<S, float>)
      gather_packs(lanes, out);
    else
      gather_scalars(lanes, out);
  }

 private:
  /// How many are stored changes with the rotations.
  template <class T>
  static void make_room(Array<T>& array, std::size_t size, bool keep) {
    if (size > array.capacity()) {
      const bool is_first = array.capacity() == 0;
      if (!keep) array = {};
      array.reserve(is_first ? size : size + size / 8);
    }
    array.resize(size);
  }
  /// What is known, to where it is to begin.
  template <class T>
  void move_known(Array<T>& array, std::size_t size, bool coded,
                  const std::vector<std::uint32_t>& begin) const {
    Array<T> moved;
    moved.reserve(size + size / 8);
    moved.resize(size);
    for (std::size_t g = 0; g < traits_.size(); ++g)
      if (knows_unrotated(g) && is_coded(g) == coded)
        std::copy_n(array.begin() + static_cast<std::ptrdiff_t>(kGroup * std::size_t{begin_[g]}),
                    kGroup * entries_of(g),
                    moved.begin() + static_cast<std::ptrdiff_t>(kGroup * std::size_t{begin[g]}));
    array = std::move(moved);
  }

  void clear(std::size_t group, int traits) {
    traits_[group] = static_cast<std::uint8_t>(traits_[group] & ~traits);
  }

  static constexpr std::uint8_t kFull = 1, kCoded = 2, kNone = 4, kMayBeElement = 8, kElement = 16,
                                kTurned = 32;
  enum class Known : std::uint8_t { no, yes, never };
  bool is_coded(std::size_t group) const { return (traits_[group] & kCoded) != 0; }
  std::size_t rotations_of(std::size_t group) const {
    return 4 * kGroup * std::size_t{rotations_at_[group]};
  }
  int entries_of(std::size_t group) const {
    return with_translations(group) ? kernels::kEntries : kernels::kModeEntries;
  }

  bool is_stored(std::size_t group) const { return (traits_[group] & (kNone | kElement)) == 0; }

  void gather_packs(const std::int32_t (&lanes)[P::kLanes], P (&out)[kernels::kEntries]) const {
    LaneSources<std::int16_t> codes;
    LaneSources<S> plain, full;  // those of `plain` that have all entries
    alignas(kPackBytes) S unit[P::kLanes] = {};
    int coded = 0;  // entries of all groups with codes
    for (int k = 0; k < P::kLanes; ++k) {
      if (lanes[k] < 0) continue;
      const auto lane = static_cast<std::size_t>(lanes[k]);
      const std::size_t group = lane / kGroup, at = kGroup * std::size_t{begin_[group]};
      const int within = lanes[k] % kGroup;
      if (!is_stored(group)) continue;
      if (is_coded(group)) {
        unit[k] = unit_[lane];
        codes.add(k, codes_.data() + at, within);
        coded = entries_of(group);
      } else {
        plain.add(k, plain_.data() + at, within);
        if (with_translations(group)) full.add(k, plain_.data() + at, within);
      }
    }
    constexpr int kSome = kernels::kModeEntries, kAll = kernels::kEntries;
    const P units = load_pack(unit);
    const auto widen = [](const std::int16_t* from) { return widened(from); };
    const auto load = [](const S* from) { return load_pack(from); };
    codes.gather(0, coded, widen, units, false, out);
    std::fill(out + (plain.empty() ? coded : std::max(coded, kSome)), out + kAll, P(S(0)));
    plain.gather(0, kSome, load, P(S(1)), coded > 0, out);
    full.gather(kSome, kAll, load, P(S(1)), true, out);
  }

  /// Entry by entry, so that those of the lanes come from memory side by side.
  void gather_scalars(const std::int32_t (&lanes)[P::kLanes], P (&out)[kernels::kEntries]) const {
    std::fill(out, out + kernels::kEntries, P(0));
    struct Plain {
      int lane, count;
      const S* from;
    } plain[P::kLanes];
    int size = 0, most = 0;
    for (int k = 0; k < P::kLanes; ++k) {
      if (lanes[k] < 0) continue;
      const auto lane = static_cast<std::size_t>(lanes[k]);
      const std::size_t group = lane / kGroup;
      if (!is_stored(group)) continue;
      plain[size++] = {k, entries_of(group),
                       plain_.data() + kGroup * std::size_t{begin_[group]} + lane % kGroup};
      most = std::max(most, entries_of(group));
    }
    for (int e = 0; e < most; ++e)
      for (int n = 0; n < size; ++n)
        if (e < plain[n].count)
          out[e].set(plain[n].lane, plain[n].from[kGroup * static_cast<std::size_t>(e)]);
  }

  void encode(std::size_t group, int first, int count, const P (&entries)[kernels::kEntries]) {
    // Several at a time, since each waits for the one before.
    P sizes[4] = {P(0), P(0), P(0), P(0)};
    int done = 0;
    for (; done + 4 <= count; done += 4)
      for (int k = 0; k < 4; ++k) sizes[k] = greater_size(entries[done + k], sizes[k]);
    for (; done < count; ++done) sizes[0] = greater_size(entries[done], sizes[0]);
    const P greatest =
        greater_size(greater_size(sizes[0], sizes[1]), greater_size(sizes[2], sizes[3]));
    const P none = P(S(1e-30));
    const P unit = select(greatest > none, greatest, none) * P(S(1) / S(kGreatestCode));
    const P inverse = P(S(1)) / unit;
    store_pack(unit_.data() + kGroup * group + first, unit);
    std::int16_t* to = codes_.data() + kGroup * std::size_t{begin_[group]} + first;
    for (int e = 0; e < count; ++e) store_narrowed(to + kGroup * e, entries[e] * inverse);
  }

  std::vector<std::uint32_t> begin_;         // per group: entries before it, in its array
  std::vector<std::uint32_t> rotations_at_;  // per group: those with room for them before it
  std::vector<std::uint8_t> traits_;         // per group
  std::vector<Known> known_;  // per group: whether its matrix without rotation is stored
  bool any_turned_ = false;
  Array<S> rotations_;  // [w x y z][lane] of each
  Array<S> plain_;
  Array<std::int16_t> codes_;
  Array<S> unit_;  // per lane
};

}  // namespace kerf::cpu
