// SPDX-License-Identifier: MIT
//
// Loops over vectors, and sums over them in a fixed order. A body is what one thread does: plain
// pointers, an index, and no more, for a device and for the host.
//
// Order   A sum is taken by `lanes` threads, lane p of entries p, p + lanes, ..., each in its
// order;
//         then 256 threads sum lanes, if there are more; then one sums what is left. The number of
//         lanes follows from the size alone, so that the bits are the same from run to run.
#pragma once

#include "gpu/level_view.hpp"
#include "kernels/noise.hpp"

namespace kerf::gpu {

template <class From, class To>
struct CopyBody {
  const From* from;
  To* to;

  KERF_HD void operator()(std::int32_t i) const { to[i] = static_cast<To>(from[i]); }
};

template <class T>
struct ZeroBody {
  T* x;

  KERF_HD void operator()(std::int32_t i) const { x[i] = T(0); }
};

/// A number that the host knows, or that the device has found.
struct Factor {
  double value = 0;
  const double* at = nullptr;

  KERF_HD double get() const { return at != nullptr ? *at : value; }
};

/// y = a x + b y, computed in T; y is not read where b is zero.
template <class From, class To, class T = To>
struct CombineBody {
  Factor a, b;
  const From* x;
  To* y;

  KERF_HD void operator()(std::int32_t i) const {
    const T p = static_cast<T>(a.get()), q = static_cast<T>(b.get());
    const T first = p * static_cast<T>(x[i]);
    y[i] = static_cast<To>(q == T(0) ? first : first + q * static_cast<T>(y[i]));
  }
};

template <class T>
struct NoiseBody {
  T* x;

  KERF_HD void operator()(std::int32_t i) const {
    x[i] = static_cast<T>(kernels::noise(static_cast<std::uint64_t>(i)));
  }
};

template <class T>
struct MaskBody {
  const std::uint8_t* fixed;
  T* x;

  KERF_HD void operator()(std::int32_t vertex) const {
    store(x, vertex, masked(load(static_cast<const T*>(x), vertex), fixed[vertex]));
  }
};

/// Three values for each of some vertices, and back.
template <class T>
struct ScatterBody {
  const std::int32_t* vertex;
  const double* values;
  T* x;

  KERF_HD void operator()(std::int32_t i) const {
    x[3 * static_cast<std::size_t>(vertex[i / 3]) + static_cast<std::size_t>(i % 3)] =
        static_cast<T>(values[i]);
  }
};
template <class T>
struct GatherBody {
  const std::int32_t* vertex;
  const T* x;
  double* values;

  KERF_HD void operator()(std::int32_t i) const {
    values[i] = static_cast<double>(
        x[3 * static_cast<std::size_t>(vertex[i / 3]) + static_cast<std::size_t>(i % 3)]);
  }
};

// ---- sums ----------------------------------------------------------------------------------

inline constexpr int kLastLanes = 256;

/// x.y
template <class A, class B>
struct DotTerms {
  static constexpr int kSums = 1;
  const A* x;
  const B* y;

  KERF_HD void add(std::int32_t i, double (&sum)[kSums]) const {
    sum[0] += static_cast<double>(x[i]) * static_cast<double>(y[i]);
  }
};

/// x.y and x.z
template <class A, class B>
struct TwoDotTerms {
  static constexpr int kSums = 2;
  const A* x;
  const B *y, *z;

  KERF_HD void add(std::int32_t i, double (&sum)[kSums]) const {
    const auto at = static_cast<double>(x[i]);
    sum[0] += at * static_cast<double>(y[i]);
    sum[1] += at * static_cast<double>(z[i]);
  }
};

/// x.y, x.z and x.w
template <class T>
struct ThreeDotTerms {
  static constexpr int kSums = 3;
  const T *x, *y, *z, *w;

  KERF_HD void add(std::int32_t i, double (&sum)[kSums]) const {
    const auto at = static_cast<double>(x[i]);
    sum[0] += at * static_cast<double>(y[i]);
    sum[1] += at * static_cast<double>(z[i]);
    sum[2] += at * static_cast<double>(w[i]);
  }
};

/// x += a d, r -= a q, and r.r; where a is zero d and q are not read, for they may be no numbers.
template <class T>
struct AdvanceTerms {
  static constexpr int kSums = 1;
  Factor a;
  const T *d, *q;
  double* x;
  T* r;

  KERF_HD void add(std::int32_t i, double (&sum)[kSums]) const {
    const double step = a.get();
    auto left = static_cast<double>(r[i]);
    if (step != 0) {
      x[i] += step * static_cast<double>(d[i]);
      left -= step * static_cast<double>(q[i]);
      r[i] = static_cast<T>(left);
    }
    sum[0] += left * left;
  }
};

/// part[n lanes + p]: sum n of lane p.
template <class Terms>
struct PartialSums {
  Terms terms;
  std::int32_t size, lanes;
  double* part;

  KERF_HD void operator()(std::int32_t p) const {
    double sum[Terms::kSums] = {};
    for (std::int32_t i = p; i < size; i += lanes) terms.add(i, sum);
    for (int n = 0; n < Terms::kSums; ++n) part[n * lanes + p] = sum[n];
  }
};

/// Lanes to kLastLanes lanes, of one sum after the other.
struct FoldSums {
  std::int32_t lanes;
  const double* part;
  double* folded;

  KERF_HD void operator()(std::int32_t i) const {
    const double* const from = part + static_cast<std::size_t>(i / kLastLanes) * lanes;
    double sum = 0;
    for (std::int32_t p = i % kLastLanes; p < lanes; p += kLastLanes) sum += from[p];
    folded[i] = sum;
  }
};

/// The sums themselves, handed to `then`. One thread.
template <int sums, class Then>
struct TotalSums {
  std::int32_t lanes;
  const double* part;
  Then then;

  KERF_HD void operator()(std::int32_t) const {
    double sum[sums] = {};
    for (int n = 0; n < sums; ++n)
      for (std::int32_t p = 0; p < lanes; ++p) sum[n] += part[n * lanes + p];
    then(sum);
  }
};

template <int sums>
struct StoreSums {
  double* out;

  KERF_HD void operator()(const double (&sum)[sums]) const {
    for (int n = 0; n < sums; ++n) out[n] = sum[n];
  }
};

// ---- conjugate gradients ---------------------------------------------------------------------

/// What stays on the device between two steps.
struct ConjugateScalars {
  double rho, alpha, beta, curvature, residual2, is_valid;
};

/// From z.r and z.q: beta of the next direction.
struct ConjugateDirection {
  ConjugateScalars* s;
  bool first;

  KERF_HD void operator()(const double (&sum)[2]) const {
    s->is_valid = sum[0] > 0 ? 1 : 0;
    s->beta = first || s->is_valid == 0 ? 0 : -s->alpha * sum[1] / s->rho;
    s->rho = sum[0];
  }
};

/// From d.q and d.r: the step along the direction; none where rounding has won.
struct ConjugateStep {
  ConjugateScalars* s;

  KERF_HD void operator()(const double (&sum)[2]) const {
    s->curvature = sum[0];
    if (!(sum[0] > 0)) s->is_valid = 0;
    s->alpha = s->is_valid != 0 ? sum[1] / sum[0] : 0;
  }
};

// ---- the K-cycle -----------------------------------------------------------------------------

/// Of one level; the notation of [NV08].
struct KrylovScalars {
  double rho, step, minus_step;  ///< of the first direction, which is kKrylovX
  double first, second;          ///< of kKrylovX and kSolution in the result
};

/// From x.v and x.f: the step along the first direction.
struct KrylovFirst {
  KrylovScalars* s;

  KERF_HD void operator()(const double (&sum)[2]) const {
    s->rho = sum[0];
    s->step = sum[0] > 0 ? sum[1] / sum[0] : 0;
    s->minus_step = -s->step;
  }
};

/// From u.v, u.Au and u.f of the second direction u: what the two are to be multiplied by.
struct KrylovSecond {
  KrylovScalars* s;

  KERF_HD void operator()(const double (&sum)[3]) const {
    const double gamma = sum[0], beta = sum[1], alpha = sum[2];
    s->first = s->rho > 0 ? s->step : 1;
    s->second = 0;
    if (!(s->rho > 0)) return;
    const double rho2 = beta - gamma * gamma / s->rho;
    if (!(rho2 > 0)) return;
    s->second = alpha / rho2;
    s->first -= gamma * alpha / (s->rho * rho2);
  }
};

}  // namespace kerf::gpu
