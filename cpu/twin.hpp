// SPDX-License-Identifier: MIT
//
// Two packs that the bodies of kernels/ take for one: what one waits for, the other one has time
// for. Processors look ahead less far than a long chain of operations goes.
#pragma once

#include <type_traits>

#include "cpu/pack.hpp"
#include "kernels/mat3.hpp"

namespace kerf::cpu {

template <class P>
struct TwinMask {
  typename P::Mask a, b;

  friend TwinMask operator&&(const TwinMask& x, const TwinMask& y) {
    return {x.a && y.a, x.b && y.b};
  }
  friend TwinMask operator||(const TwinMask& x, const TwinMask& y) {
    return {x.a || y.a, x.b || y.b};
  }
  friend TwinMask operator!(const TwinMask& x) { return {!x.a, !x.b}; }
};

template <class P>
struct Twin {
  using Mask = TwinMask<P>;
  P a, b;

  Twin() {}
  Twin(const P& first, const P& second) : a(first), b(second) {}
  template <class Number>
  requires std::is_arithmetic_v<Number>
  explicit Twin(Number s) : a(s), b(s) {}

  friend Twin operator+(const Twin& x, const Twin& y) { return {x.a + y.a, x.b + y.b}; }
  friend Twin operator-(const Twin& x, const Twin& y) { return {x.a - y.a, x.b - y.b}; }
  friend Twin operator*(const Twin& x, const Twin& y) { return {x.a * y.a, x.b * y.b}; }
  friend Twin operator/(const Twin& x, const Twin& y) { return {x.a / y.a, x.b / y.b}; }
  friend Twin operator-(const Twin& x) { return {-x.a, -x.b}; }
  friend Mask operator<(const Twin& x, const Twin& y) { return {x.a < y.a, x.b < y.b}; }
  friend Mask operator>(const Twin& x, const Twin& y) { return {x.a > y.a, x.b > y.b}; }
  friend Mask operator<=(const Twin& x, const Twin& y) { return {x.a <= y.a, x.b <= y.b}; }

  friend Twin fma(const Twin& x, const Twin& y, const Twin& z) {
    return {fma(x.a, y.a, z.a), fma(x.b, y.b, z.b)};
  }
  friend Twin greater_size(const Twin& x, const Twin& y) {
    return {greater_size(x.a, y.a), greater_size(x.b, y.b)};
  }
  friend Twin sqrt(const Twin& x) { return {sqrt(x.a), sqrt(x.b)}; }
  friend Twin select(const Mask& mask, const Twin& x, const Twin& y) {
    return {select(mask.a, x.a, y.a), select(mask.b, x.b, y.b)};
  }
};

template <class P>
kernels::Sym3<Twin<P>> twins(const kernels::Sym3<P>& a, const kernels::Sym3<P>& b) {
  return {{a.xx, b.xx}, {a.xy, b.xy}, {a.xz, b.xz}, {a.yy, b.yy}, {a.yz, b.yz}, {a.zz, b.zz}};
}

/// body(which, pack).
template <class S, int kBytes, class Body>
void for_each_pack(const Pack<S, kBytes>& x, const Body& body) {
  body(0, x);
}
template <class P, class Body>
void for_each_pack(const Twin<P>& x, const Body& body) {
  body(0, x.a);
  body(1, x.b);
}

template <class P>
bool all(const TwinMask<P>& mask) {
  return all(mask.a && mask.b);
}

}  // namespace kerf::cpu

namespace kerf::kernels {
template <class P>
struct Precision<cpu::Twin<P>> : Precision<P> {};
}  // namespace kerf::kernels
