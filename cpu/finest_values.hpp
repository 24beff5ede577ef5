// SPDX-License-Identifier: MIT
//
// What the elements of level 0 are made of: rotations and materials.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "core/base/array.hpp"
#include "cpu/patched_level.hpp"
#include "cpu/stored_matrices.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/modes.hpp"
#include "kernels/rotation.hpp"

namespace kerf::cpu {

/// Constants of one Poisson ratio and mass model, in every lane.
template <class S>
struct PackedMaterial {
  kernels::ModeConstants<Pack<S>> modes;
  kernels::HexStiffness<Pack<S>> stiffness;
  kernels::HexMass<Pack<S>> mass;
};

/// Rotations of the cells of level 0, [group][w x y z][lane]. In single precision with what
/// rounding left of them: what is asked for in double is the sum of both, to 2^-48 of a component.
template <class S>
class FinestRotations {
 public:
  static constexpr std::size_t kScalars = 4 * kGroup;  // of a group

  /// Where w of a lane lies; the others follow in steps of a group.
  static std::size_t place(std::size_t lane) { return kScalars * (lane / kGroup) + lane % kGroup; }
  const S* of(std::size_t lane) const { return rounded_.data() + place(lane); }

  /// In the precision T; in single precision rounded.
  template <class T>
  T component(std::size_t lane, std::size_t c) const {
    const std::size_t from = place(lane) + kGroup * c;
    T q = static_cast<T>(rounded_[from]);
    if constexpr (std::is_same_v<T, double> && kHasRest) q += static_cast<T>(rest_[from]);
    return q;
  }
  std::array<double, 4> at(std::size_t lane) const {
    std::array<double, 4> q;
    for (std::size_t c = 0; c < 4; ++c) q[c] = component<double>(lane, c);
    return q;
  }
  void put(std::size_t lane, const std::array<double, 4>& q) {
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t to = place(lane) + kGroup * k;
      const double sum = kHasRest ? without_last_bits(q[k]) : q[k];
      rounded_[to] = static_cast<S>(sum);
      if constexpr (kHasRest) rest_[to] = static_cast<S>(sum - static_cast<double>(rounded_[to]));
    }
  }

  /// Of a pack, in the precision T; in single precision rounded.
  template <class T>
  kernels::Quat<Pack<T>> load(std::size_t group, int first_lane) const {
    const std::size_t from = kScalars * group + static_cast<std::size_t>(first_lane);
    const auto part = [&](std::size_t c) {
      Pack<T> q = load_pack_as<T>(rounded_.data() + from + kGroup * c);
      if constexpr (std::is_same_v<T, double> && kHasRest)
        q += load_pack_as<T>(rest_.data() + from + kGroup * c);
      return q;
    };
    return {part(0), part(1), part(2), part(3)};
  }
  void store(std::size_t group, int first_lane, const kernels::Quat<Pack<double>>& q) {
    const std::size_t to = kScalars * group + static_cast<std::size_t>(first_lane);
    if constexpr (!kHasRest) return store_quaternion(rounded_.data() + to, q);
    const auto part = [&](std::size_t c, const Pack<double>& of) {
      const Pack<double> sum = without_last_bits(of);
      const Pack<double> rounded = store_pack_as(rounded_.data() + to + kGroup * c, sum);
      store_pack_as(rest_.data() + to + kGroup * c, sum - rounded);
    };
    part(0, q.w);
    part(1, q.x);
    part(2, q.y);
    part(3, q.z);
  }
  /// Asks memory for those that are needed a few groups later.
  template <class T>
  void prefetch_behind(std::size_t group) const {
    constexpr std::size_t kAhead = 4;
    prefetch(rounded_.data(), kScalars * (group + kAhead), kScalars);
    if constexpr (kHasRest && !std::is_same_v<T, S>)
      prefetch(rest_.data(), kScalars * (group + kAhead), kScalars);
  }

  /// The same for those that will be stored.
  void prefetch_to_store(std::size_t group) const {
    constexpr std::size_t kAhead = 8;
    prefetch<true>(rounded_.data(), kScalars * (group + kAhead), kScalars);
    if constexpr (kHasRest) prefetch<true>(rest_.data(), kScalars * (group + kAhead), kScalars);
  }

  /// The identity in so many groups, all that there are.
  void start(std::size_t groups) {
    rounded_.clear();
    rest_.clear();
    resize(groups);
    no_rotation(0, groups);
  }
  void resize(std::size_t groups) {
    rounded_.resize(kScalars * groups);
    if constexpr (kHasRest) rest_.resize(kScalars * groups);
  }
  /// The identity in some groups.
  void no_rotation(std::size_t begin, std::size_t end) {
    for (std::size_t lane = kGroup * begin; lane < kGroup * end; ++lane) put(lane, {1, 0, 0, 0});
  }
  std::size_t bytes() const { return bytes_of(rounded_) + bytes_of(rest_); }

 private:
  static constexpr bool kHasRest = !std::is_same_v<S, double>;
  static constexpr std::int64_t kLastBits = 31;  // of 53, so that two numbers of 24 have the rest

  /// Rounded, so that the two numbers do not depend on how often they were added and parted.
  template <class Bits>
  static Bits rounded_bits(const Bits& bits) {
    return (bits + (kLastBits + 1) / 2) & ~kLastBits;
  }
  static double without_last_bits(double x) {
    std::int64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    bits = rounded_bits(bits);
    std::memcpy(&x, &bits, sizeof x);
    return x;
  }
  static Pack<double> without_last_bits(const Pack<double>& x) {
    using Bits = PackMask<double>::Vector;
    return Pack<double>::Vector(rounded_bits(Bits(x.v)));
  }

  Array<S> rounded_, rest_;
};

/// What products in the precision T read.
template <class T, class S>
struct FinestValues {
  const FinestRotations<S>& rotations;
  const std::vector<PackedMaterial<T>>& materials;

  kernels::Quat<Pack<T>> quaternion(std::size_t group, int first_lane) const {
    return rotations.template load<T>(group, first_lane);
  }
  void prefetch_behind(std::size_t group) const { rotations.template prefetch_behind<T>(group); }
};

}  // namespace kerf::cpu
