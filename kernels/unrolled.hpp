// SPDX-License-Identifier: MIT
//
// Loops whose counter is a constant: what they index stays in registers, and indices into a packed
// triangle are none at run time. GCC 12 unrolls short loops by itself, but those in loops so late
// that arrays of packs have been given memory, to which it then writes every entry.
#pragma once

#include "kernels/host_device.hpp"

namespace kerf::kernels {

template <int n>
struct Constant {
  static constexpr int value = n;
  KERF_HD constexpr operator int() const { return n; }  // NOLINT: a counter is a number
};
template <int... n>
struct Counters {};
template <int count, int... n>
struct CountersBelow : CountersBelow<count - 1, count - 1, n...> {};
template <int... n>
struct CountersBelow<0, n...> {
  using List = Counters<n...>;
};
template <class F, int... n>
KERF_HD void unrolled(Counters<n...>, const F& f) {
  (f(Constant<n>{}), ...);
}

/// f(Constant<0>) to f(Constant<count - 1>).
template <int count, class F>
KERF_HD void unrolled(const F& f) {
  unrolled(typename CountersBelow<count>::List{}, f);
}

}  // namespace kerf::kernels
