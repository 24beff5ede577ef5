// SPDX-License-Identifier: MIT
//
// Multigrid in the mode basis: the matrix of a cell by modes, its Galerkin product, its use.
//
// A cell matrix is A = H^T S H with the H of modes.hpp. A child sees xi_parent = (xi + sigma) / 2
// along each axis, sigma = -1 or +1 for its half, so the parent's mode S is in the child
//     2^-|S| sum_(T in S) sigma^(S \ T) (mode T),
// one axis after the other: along an axis, p a mode without it and q = p with it,
//     m_p = M_p + sigma/2 M_q,   m_q = M_q / 2.
// Sums over low and high child are shared by all entries; 600 additions a child, where coarsen_cell
// takes 3900 products.
//
// The matrix of a finest cell is, with C_ab[i][k] the force along i on the derivative along axis a
// from the derivative along b of component k, and R = (r_x r_y r_z),
//     C_ab = stiffness (b r_a r_b^T + e r_b r_a^T + e delta_ab I)        (b, e of ModeStiffness)
//     S(T, T') = sum of 3^-|T \ a| C_ab over a in T, b in T' with T \ a = T' \ b,
// for the mean of xi^2 is 1/3. A parent takes the same sum over all a in S, b in S': each axis
// counts 1, sigma/2 or 1/3 as S \ a and S' \ b have it never, once or both. So finest children
// enter by their signed sums alone, the Walsh transform of their C over the octants.
//
// Layout   Packed lower triangle (layout.hpp) over the unknowns 3 * (7 - mode) + component: the
//          translations, mode 0, come last. Their rows, entries 231 to 299, are zero without mass
//          and supports, and functions with `with_translations` off neither read nor write them.
//          Modes are those of the eight corners of a cube; hanging corners are the caller's.
// Entries  Matrices are read and written by [entry]: T*, CellEntries<T>, or what gives T so.
// Units    As modes.hpp: f = H^T S H u in N for u in m.
// Source   Derived here; the product is that of Dick, Georgii, Westermann 2011 [DGW11],
//          section 6.4, equation (2).
#pragma once

#include "kernels/modes.hpp"

namespace kerf::kernels {

inline constexpr int kModeEntries = 231;  // of a matrix without its translations: 21 rows

/// Place of the entry that couples component i of mode s with component k of mode t.
KERF_HD constexpr int mode_entry(int s, int i, int t, int k) {
  const int a = 3 * (7 - s) + i, b = 3 * (7 - t) + k;
  return a >= b ? packed_index(a, b) : packed_index(b, a);
}

// ---- one finest cell -----------------------------------------------------------------------

/// What C of one finest cell is made of. Arrays, since those are not set to zero first.
template <class T>
struct TurnedCell {
  T R[3][3];
  T sheared[3][3];  // shear R
  T shear;          // stiffness e
};

template <class T>
KERF_HD void turn_cell(const Mat3<T>& R, T shear, TurnedCell<T>& out) {
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) {
      out.R[i][a] = R[i][a];
      out.sheared[i][a] = shear * R[i][a];
    }
  out.shear = shear;
}

/// C_ab[i][k] for all a, b; ratio = b / e of ModeStiffness.
template <int i, int k, class T>
KERF_HD void gradient_coupling(const TurnedCell<T>& cell, T ratio, T (&C)[3][3]) {
  const T* const left = cell.sheared[i];
  const T* const right = cell.R[k];
  if constexpr (i == k) {
    const T both = T(1) + ratio;
    for (int a = 0; a < 3; ++a) {
      const T scaled = both * left[a];
      for (int b = a; b < 3; ++b) C[a][b] = C[b][a] = scaled * right[b];
      C[a][a] += cell.shear;
    }
  } else {
    T product[3][3];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) product[a][b] = left[a] * right[b];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) C[a][b] = fma(ratio, product[a][b], product[b][a]);
  }
}

/// Whether s \ a = t \ b, with a in s and b in t.
KERF_HD constexpr bool leaves_same(int s, int t, int a, int b) {
  const int bit_a = 1 << a, bit_b = 1 << b;
  return (s & bit_a) != 0 && (t & bit_b) != 0 && (s ^ bit_a) == (t ^ bit_b);
}

/// 1 / 3^n.
template <class T>
KERF_HD T third_power(int n) {
  return T(1) / T(n == 0 ? 1 : (n == 1 ? 3 : 9));
}

/// out = stiffness [R] S [R]^T + mass, all 300 entries. Some 250 slots beside the stores.
///
/// Shapes  out: kEntries scalars to write.
/// Needs   R a rotation up to rounding.
template <class T, class Out>
KERF_HD void finest_mode_matrix(const Mat3<T>& R, T stiffness, T mass,
                                const ModeConstants<T>& constants, Out out) {
  const T ratio = constants.stiffness.b / constants.stiffness.e;
  TurnedCell<T> cell;
  turn_cell(R, stiffness * constants.stiffness.e, cell);
  unrolled<9>([&](auto component) {
    constexpr int i = decltype(component)::value / 3, k = decltype(component)::value % 3;
    T C[3][3];
    gradient_coupling<i, k>(cell, ratio, C);
    unrolled<64>([&](auto pair) {
      constexpr int s = decltype(pair)::value / 8, t = decltype(pair)::value % 8;
      // Rows are the lower modes.
      if constexpr (s < t || (s == t && i >= k)) {
        T sum = s == t && i == k ? mass * constants.mass[mode_axes(s)] : T(0);
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            if (leaves_same(s, t, a, b)) sum = fma(third_power<T>(mode_axes(s) - 1), C[a][b], sum);
        out[mode_entry(s, i, t, k)] = sum;
      }
    });
  });
}

/// The diagonal 3x3 blocks of H^T S H, by corners, of one finest cell, without S:
///     D = stiffness ((16/9 (b + 4 e) - 4/3 (b + e)) I + 4/3 (b + e) v v^T) + mass,
/// v = R chi the direction from the centre to the corner. Opposite corners have the same block.
template <class T>
KERF_HD void finest_diagonal_blocks(const Mat3<T>& R, T stiffness, T mass,
                                    const ModeConstants<T>& constants, Sym3<T> (&D)[kCorners]) {
  const T b = constants.stiffness.b, e = constants.stiffness.e;
  const T along = (T(4) / T(3)) * stiffness * (b + e);
  const T trace = (T(16) / T(9)) * stiffness * (b + T(4) * e);
  const T* const m = constants.mass;
  const T all = mass * (m[0] + T(3) * (m[1] + m[2]) + m[3]) + (trace - along);
  for (int i = 0; i < 4; ++i) {
    Vec3<T> v{R[0][2], R[1][2], R[2][2]};  // of corner i + 4
    for (int a = 0; a < 2; ++a) {
      const Vec3<T> r{R[0][a], R[1][a], R[2][a]};
      if (((i >> a) & 1) != 0)
        v += r;
      else
        v -= r;
    }
    const Vec3<T> w = along * v;
    D[i + 4] = D[3 - i] = {fma(w.x, v.x, all), w.x * v.y, w.x * v.z,
                           fma(w.y, v.y, all), w.y * v.z, fma(w.z, v.z, all)};
  }
}

// ---- a parent of eight finest cells --------------------------------------------------------

/// to_modes for the modes without an axis alone: half the work.
template <int axis, class T>
KERF_HD void modes_across(T (&v)[kCorners]) {
  constexpr int bit = 1 << axis, next = axis == 0 ? 2 : 1, last = axis == 2 ? 2 : 4;
  for (int i = 0; i < kCorners; ++i)
    if ((i & bit) == 0) v[i] += v[i + bit];
  walsh_axis<next, bit>(v);
  walsh_axis<last, bit>(v);
}

/// Entry (s, t) of a parent: the sum over a in s, b in t, where an axis in neither, one or both of
/// s \ a and t \ b counts 1, sigma/2 or 1/3 = 4/3 / 2^2. All the halves of an entry are one factor.
template <int s, int t, bool symmetric, class T>
KERF_HD T sum_moments(const T (&w)[3][3][kCorners]) {
  T sum = T(0);
  bool empty = true;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const int left = s & ~(1 << a), right = t & ~(1 << b);
      if (left == s || right == t) continue;
      const bool swap = symmetric && a > b;
      const T& moment = w[swap ? b : a][swap ? a : b][left ^ right];
      const int shared = mode_axes(left & right);
      if (shared != 0)
        sum = fma(T(shared == 1 ? 4 : 16) / T(shared == 1 ? 3 : 9), moment, sum);
      else
        sum = empty ? moment : sum + moment;
      empty = false;
    }
  constexpr int halves = mode_axes(s) + mode_axes(t) - 2;
  return halves == 0 ? sum : (T(1) / T(1 << halves)) * sum;
}

/// The entries of a parent that couple components i and k; i <= k.
template <int i, int k, class T, class Out>
KERF_HD void coarsen_component(const TurnedCell<T> (&cells)[kCorners], T ratio, Out out) {
  T w[3][3][kCorners];
  for (int o = 0; o < kCorners; ++o) {
    T C[3][3];
    gradient_coupling<i, k>(cells[o], ratio, C);
    for (int a = 0; a < 3; ++a)
      for (int b = i == k ? a : 0; b < 3; ++b) w[a][b][o] = C[a][b];
  }
  unrolled<9>([&](auto pair) {
    constexpr int a = decltype(pair)::value / 3, b = decltype(pair)::value % 3;
    if constexpr (a == b)
      modes_across<a>(w[a][b]);
    else if constexpr (i != k || a < b)
      to_modes(w[a][b]);
  });
  unrolled<64>([&](auto pair) {
    constexpr int s = decltype(pair)::value / 8, t = decltype(pair)::value % 8;
    if constexpr (s != 0 && t != 0 && (i != k || s <= t))
      out[mode_entry(s, i, t, k)] = sum_moments<s, t, i == k>(w);
  });
}

/// One child of coarsen_finest. Absent: stiffness and mass zero.
template <class T>
struct FinestChild {
  Quat<T> rotation;
  T stiffness, mass;
};

/// out += the mass of eight finest cells; writes the rows of the translations.
/// A child's mode T has mass[|T|] and counts in (S, S') where T is part of both, always with the
/// sign of S xor S'.
template <class T, class Out>
KERF_HD void add_finest_mass(const FinestChild<T> (&children)[kCorners], const T (&mass)[4],
                             Out out) {
  T moment[kCorners];
  for (int o = 0; o < kCorners; ++o) moment[o] = children[o].mass;
  to_modes(moment);
  const T shared[4] = {mass[0], mass[0] + mass[1], mass[0] + T(2) * mass[1] + mass[2],
                       mass[0] + T(3) * (mass[1] + mass[2]) + mass[3]};
  for (int e = kModeEntries; e < kEntries; ++e) out[e] = T(0);
  unrolled<64>([&](auto pair) {
    constexpr int s = decltype(pair)::value / 8, t = decltype(pair)::value % 8;
    if constexpr (s <= t) {
      const T scale = T(1) / T(1 << (mode_axes(s) + mode_axes(t)));
      const T coupled = scale * shared[mode_axes(s & t)] * moment[s ^ t];
      for (int i = 0; i < 3; ++i) out[mode_entry(s, i, t, i)] += coupled;
    }
  });
}

/// out = the matrix of a parent whose children are finest cells of one material. 300 slots a child.
///
/// Needs   Rotations of length one up to rounding, also of absent children.
/// Shapes  out: with mass, kEntries scalars to write; without, the first kModeEntries.
template <bool with_mass, class T, class Out>
KERF_HD void coarsen_finest(const FinestChild<T> (&children)[kCorners],
                            const ModeConstants<T>& constants, Out out) {
  // Two derivatives on twice the side.
  const T shear = T(0.25) * constants.stiffness.e;
  const T ratio = constants.stiffness.b / constants.stiffness.e;
  TurnedCell<T> cells[kCorners];
  for (int o = 0; o < kCorners; ++o)
    turn_cell(to_matrix(children[o].rotation), shear * children[o].stiffness, cells[o]);
  coarsen_component<0, 0>(cells, ratio, out);
  coarsen_component<1, 1>(cells, ratio, out);
  coarsen_component<2, 2>(cells, ratio, out);
  coarsen_component<0, 1>(cells, ratio, out);
  coarsen_component<0, 2>(cells, ratio, out);
  coarsen_component<1, 2>(cells, ratio, out);
  if constexpr (with_mass) add_finest_mass(children, constants.mass, out);
}

// ---- a parent of any eight cells -----------------------------------------------------------

/// Entries to store: with_translations or not.
template <bool with_translations>
inline constexpr int kStoredEntries = with_translations ? kEntries : kModeEntries;

/// An entry of the two halves of a cell along an axis: high + low and high - low.
template <class T>
struct Halves {
  T sum, difference;
};

/// Both halves present.
template <class T, class Entries>
struct BothHalves {
  const Entries& low;
  const Entries& high;

  KERF_HD Halves<T> operator[](int entry) const {
    const T above = high[entry], below = low[entry];
    return {above + below, above - below};
  }
};

/// One half: sign is 1 where it is the high one, -1 where it is the low one.
template <class T, class Entries>
struct OneHalf {
  const Entries& half;
  T sign;

  KERF_HD Halves<T> operator[](int entry) const {
    const T value = half[entry];
    return {value, sign * value};
  }
};

/// The factors 1/2 of the modes s and t, where they are due.
template <bool due, int s, int t, class T>
KERF_HD T halved(const T& value) {
  constexpr int halves = mode_axes(s) + mode_axes(t);
  if constexpr (due && halves != 0)
    return (T(1) / T(1 << halves)) * value;
  else
    return value;
}

/// The congruence along an axis for the unknowns (p, i) and (r, k), modes without the axis, and
/// their partners (q, i) and (u, k), modes with it. Modes with the axis come out twice too large;
/// the last axis brings in the factors of all three.
template <int axis, int p, int i, int r, int k, bool with_translations, class Source, class Out>
KERF_HD void coarsen_quad(const Source& source, Out out) {
  constexpr int q = p | (1 << axis), u = r | (1 << axis);
  constexpr bool last = axis == 2;
  constexpr bool has_p = with_translations || p != 0, has_r = with_translations || r != 0;
  const auto qu = source[mode_entry(q, i, u, k)];
  auto sum = qu.sum;
  auto pr = qu, qr = qu, pu = qu;
  if constexpr (has_p && has_r) {
    pr = source[mode_entry(p, i, r, k)];
    out[mode_entry(p, i, r, k)] = halved<last, p, r>(pr.sum);
    sum += pr.sum;
  }
  if constexpr (has_r) {
    qr = source[mode_entry(q, i, r, k)];
    sum += qr.difference;
    if constexpr (has_p) qr.sum += pr.difference;
    out[mode_entry(q, i, r, k)] = halved<last, q, r>(qr.sum);
  }
  if constexpr (has_p && p == r && i == k) {
    sum += qr.difference;
  } else if constexpr (has_p) {
    pu = source[mode_entry(p, i, u, k)];
    sum += pu.difference;
    if constexpr (has_r) pu.sum += pr.difference;
    out[mode_entry(p, i, u, k)] = halved<last, p, u>(pu.sum);
  }
  out[mode_entry(q, i, u, k)] = halved<last, q, u>(sum);
}

/// out = the halves along an axis brought together.
template <int axis, bool with_translations, class Source, class Out>
KERF_HD void coarsen_axis(const Source& source, Out out) {
  unrolled<12>([&](auto row) {
    unrolled<decltype(row)::value + 1>([&](auto col) {
      // Unknown 3 n + i of the four modes without the axis; n has its two other bits.
      constexpr int below = (1 << axis) - 1;
      constexpr int n = decltype(row)::value / 3, m = decltype(col)::value / 3;
      constexpr int p = (n & below) | ((n & ~below) << 1), r = (m & below) | ((m & ~below) << 1);
      coarsen_quad<axis, p, decltype(row)::value % 3, r, decltype(col)::value % 3,
                   with_translations>(source, out);
    });
  });
}

/// The halves along x; bit 0 of `present` for the low one, bit 1 for the high one.
template <bool with_translations, class T, class Children>
KERF_HD void coarsen_children(const Children& child, int octant, unsigned present, T* out) {
  if (present == 3) {
    const auto low = child(octant), high = child(octant + 1);
    coarsen_axis<0, with_translations>(BothHalves<T, decltype(low)>{low, high}, out);
  } else if (present != 0) {
    const bool is_high = present == 2;
    const auto half = child(octant + (is_high ? 1 : 0));
    coarsen_axis<0, with_translations>(OneHalf<T, decltype(half)>{half, T(is_high ? 1 : -1)}, out);
  } else {
    for (int e = 0; e < kStoredEntries<with_translations>; ++e) out[e] = T(0);
  }
}

/// out = the matrix of a parent of any eight cells: stored ones, or ones computed when asked for.
/// 600 additions a child, 780 with translations. An absent child counts as zeros and is not read.
///
/// Shapes  child(octant): what [entry] reads; asked once for each octant with its bit in `present`,
///         rising, of two along x before either is read. out: kStoredEntries scalars to write.
template <bool with_translations, class T, class Children, class Out>
KERF_HD void coarsen_modes(const Children& child, unsigned present, Out out) {
  // Depth first: four matrices, which stay in the nearest cache.
  T along_x[2][kStoredEntries<with_translations>], along_y[2][kStoredEntries<with_translations>];
  for (int z = 0; z < 2; ++z) {
    if (((present >> (4 * z)) & 15U) == 0) {
      for (T& entry : along_y[z]) entry = T(0);
      continue;
    }
    for (int y = 0; y < 2; ++y) {
      const int octant = 4 * z + 2 * y;
      coarsen_children<with_translations>(child, octant, (present >> octant) & 3U, along_x[y]);
    }
    const T* const low = along_x[0];
    const T* const high = along_x[1];
    coarsen_axis<1, with_translations>(BothHalves<T, const T*>{low, high}, along_y[z]);
  }
  const T* const low = along_y[0];
  const T* const high = along_y[1];
  coarsen_axis<2, with_translations>(BothHalves<T, const T*>{low, high}, out);
}

// ---- use -----------------------------------------------------------------------------------

/// Row s of a symmetric product: out[s] = A_st in[t] summed over t >= s, and out[t] += A_st^T in[s]
/// of t > s.
template <int s, class T, class Matrix>
KERF_HD void apply_mode_row(const Matrix& A, const T (&in)[3][kCorners], T (&out)[3][kCorners]) {
  const T own[3] = {in[0][s], in[1][s], in[2][s]};
  T sum[3];
  // Unrolled by hand: GCC 12 leaves loops here, whose sums then go through memory.
  unrolled<7 - s>([&](auto col) {
    constexpr int t = 7 - decltype(col)::value;
    const T other[3] = {in[0][t], in[1][t], in[2][t]};
    T across[3] = {out[0][t], out[1][t], out[2][t]};
    unrolled<9>([&](auto entry) {
      constexpr int i = decltype(entry)::value / 3, k = decltype(entry)::value % 3;
      const T a = A[mode_entry(s, i, t, k)];
      if constexpr (t == 7 && k == 0)
        sum[i] = a * other[0];
      else
        sum[i] = fma(a, other[k], sum[i]);
      across[k] = fma(a, own[i], across[k]);
    });
    for (int k = 0; k < 3; ++k) out[k][t] = across[k];
  });
  unrolled<9>([&](auto entry) {
    constexpr int i = decltype(entry)::value / 3, k = decltype(entry)::value % 3;
    if constexpr (k <= i) {
      const T a = A[mode_entry(s, i, s, k)];
      if constexpr (s == 7 && k == 0)
        sum[i] = a * own[0];
      else
        sum[i] = fma(a, own[k], sum[i]);
      if (k < i) sum[k] = fma(a, own[i], sum[k]);
    }
  });
  for (int i = 0; i < 3; ++i) out[i][s] = sum[i];
}

/// f = A u by corners, each entry read once; f may be u.
template <bool with_translations, class T, class Matrix>
KERF_HD void apply_mode_matrix(const Matrix& A, const Vec3<T> (&u)[kCorners],
                               Vec3<T> (&f)[kCorners]) {
  T in[3][kCorners], out[3][kCorners];
  to_modes(u, in);
  // As the entries lie.
  unrolled<with_translations ? 8 : 7>(
      [&](auto row) { apply_mode_row<7 - decltype(row)::value>(A, in, out); });
  if constexpr (!with_translations) out[0][0] = out[1][0] = out[2][0] = T(0);
  to_corners(out, f);
}

/// The diagonal 3x3 blocks by corners, H^T S H, of all eight: chi_s chi_t = chi_(s xor t), so that
/// the blocks of S are summed by s xor t and the sums go to corners.
template <bool with_translations, class T, class Matrix>
KERF_HD void mode_diagonal_blocks(const Matrix& A, Sym3<T> (&D)[kCorners]) {
  constexpr int first = with_translations ? 0 : 1;
  T by_class[6][kCorners];
  unrolled<9>([&](auto component) {
    constexpr int i = decltype(component)::value / 3, k = decltype(component)::value % 3;
    if constexpr (i >= k) {
      T(&sums)[kCorners] = by_class[packed_index(i, k)];
      unrolled<8>([&](auto cls) {
        constexpr int p = decltype(cls)::value;
        T sum = T(0);
        for (int s = first; s < kCorners; ++s) {
          const int t = s ^ p;
          // Of i = k, (s, t) and (t, s) are one entry.
          if (t < first || (i == k && t < s)) continue;
          const T entry = A[mode_entry(s, i, t, k)];
          sum += i == k && p != 0 ? entry + entry : entry;
        }
        sums[p] = sum;
      });
      to_corners(sums);
    }
  });
  for (int n = 0; n < kCorners; ++n)
    D[n] = {by_class[0][n], by_class[1][n], by_class[3][n],
            by_class[2][n], by_class[4][n], by_class[5][n]};
}

/// A = R A R^T, R of each corner and so of each mode. All 300 entries.
template <class T, class Matrix>
KERF_HD void turn_mode_matrix(const Mat3<T>& R, Matrix& A) {
  const Mat3<T> transposed = transpose(R);
  for (int s = 0; s < kCorners; ++s)
    for (int t = s; t < kCorners; ++t) {
      Mat3<T> block;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) block[i][k] = A[mode_entry(s, i, t, k)];
      block = R * block * transposed;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < (s == t ? i + 1 : 3); ++k) A[mode_entry(s, i, t, k)] = block[i][k];
    }
}

/// One of two halves of the congruence with H or H^T: the 24 rows or columns as eight vectors.
template <bool corners, class T>
KERF_HD void convert_row(T (&row)[kUnknowns]) {
  for (int component = 0; component < 3; ++component) {
    T v[kCorners];
    for (int i = 0; i < kCorners; ++i) v[i] = row[3 * (corners ? 7 - i : i) + component];
    if constexpr (corners)
      to_corners(v);
    else
      to_modes(v);
    for (int i = 0; i < kCorners; ++i) row[3 * (corners ? i : 7 - i) + component] = v[i];
  }
}

template <bool corners, class T, class Matrix, class Out>
KERF_HD void convert_matrix(const Matrix& A, T scale, Out out) {
  T full[kUnknowns][kUnknowns];
  for (int row = 0; row < kUnknowns; ++row)
    for (int col = 0; col <= row; ++col)
      full[row][col] = full[col][row] = A[packed_index(row, col)];
  for (int row = 0; row < kUnknowns; ++row) convert_row<corners>(full[row]);
  for (int col = 0; col < kUnknowns; ++col) {
    T column[kUnknowns];
    for (int row = 0; row < kUnknowns; ++row) column[row] = full[row][col];
    convert_row<corners>(column);
    for (int row = col; row < kUnknowns; ++row) out[packed_index(row, col)] = scale * column[row];
  }
}

/// out = S = 1/64 H A H^T from the packed matrix A by corners, all 300 entries. Slow.
template <class T, class Matrix, class Out>
KERF_HD void modes_from_corners(const Matrix& A, Out out) {
  convert_matrix<false, T>(A, T(1) / T(64), out);
}

/// out = H^T S H, the packed matrix by corners, from all 300 entries of S. Slow.
template <class T, class Matrix, class Out>
KERF_HD void corners_from_modes(const Matrix& S, Out out) {
  convert_matrix<true, T>(S, T(1), out);
}

}  // namespace kerf::kernels
