// SPDX-License-Identifier: MIT
//
// What a phase needs at least, per cell of level 0: floating-point slots (a fused multiply-add, an
// addition or a product each take one) and bytes to and from memory. Divided by the ceilings of
// the machine they give the time that no program can beat; of_ceiling is that time over the
// measured one.
//
// The counts are those of the task in its cheapest known form, not of the code that runs, so that
// a fraction grows only when the time falls: u, f and r are 24 bytes a vertex in double, a rotation
// and its modulus 16 (a quaternion in float), neighbours are implicit, a vertex goes with a cell,
// and nothing is read twice. Cut bodies have more vertices and longer cycles than that, so their
// fraction is somewhat low. Baselines that are another algorithm by definition have counts of
// their own.
//
// Source  The tables of slots and bytes from which this solver was planned; sums stand here.
#pragma once

namespace kerf::bench {

struct Work {
  double slots = 0;
  double bytes_single = 0, bytes_double = 0;  ///< by the precision of the vectors

  constexpr Work operator+(const Work& b) const {
    return {slots + b.slots, bytes_single + b.bytes_single, bytes_double + b.bytes_double};
  }
};
constexpr Work operator*(double times, const Work& w) {
  return {times * w.slots, times * w.bytes_single, times * w.bytes_double};
}

namespace counts {

/// y = A u: 69 to modes, 21 for the matrix of a quaternion, 63 to turn, 35 in modes, 63 back, 70 to
/// corners; read u and q, write y.
inline constexpr Work kOperator{321, 40, 64};
/// The same by a dense 24x24 product: 72 + 576 + 72 + 21 and the sums.
inline constexpr Work kOperatorDense{746, 40, 64};
/// r = f - A u and |r|: 3 differences, 3 squares; f and r join.
inline constexpr Work kResidual{327, 52, 88};
/// One step x + w (b - A x) with a constant diagonal.
inline constexpr Work kDampedStep{331, 52, 88};
/// Chebyshev of degree 2: two such steps.
inline constexpr Work kChebyshev = 2 * kDampedStep;
/// Eight colours, each vertex gathers from its eight cells: 8 (21 + 72 + 72 + 9) slots.
inline constexpr Work kGaussSeidel{1412, 272, 416};
/// V(1,1) with Chebyshev of degree 2: level 1 without stored matrices, 231 scalars a cell beyond.
inline constexpr Work kCycle{2785, 370, 596};
/// The same with damped Jacobi, a step before and a step after.
inline constexpr Work kCycleJacobi{1571, 208, 335};
/// V(1,1) with Gauss-Seidel, 576 scalars a cell on all coarse levels.
inline constexpr Work kCyclePaper{4541, 1665, 3059};
/// Two Newton steps from the gradient: 51 + 2 * 85; read u and q, write q.
inline constexpr Work kRotate{221, 44, 56};
/// Galerkin products: level 0 to 1 to 2 with level 1 never stored, and a seventh of that beyond. In
/// `mixed` cells that turn as one need none (docs/decisions/0028-without-rotation.md), and less.
inline constexpr Work kCoarsen{465, 33, 33};
/// The same by nodal weights, level 1 stored.
inline constexpr Work kCoarsenPaper{5550, 337, 659};
/// R D R^T of eight corners, 36 slots each, their sum 48, an inverse 30; read q, write 6 scalars.
/// Coarse levels, a seventh: 8 blocks of 6 scalars read, 6 written, 78 slots.
inline constexpr Work kPrepare{366 + 78.0 / 7, 40 + 216.0 / 7, 64 + 432.0 / 7};
/// Twelve Lanczos steps, each an operator, a Jacobi product and its sums, after kPrepare; coarse
/// levels by 300 stored scalars.
inline constexpr Work kBound = kPrepare + 12 * Work{346 + 82, 124 + 177, 208 + 353};
/// 8 x 3 sums in three directions; read r, write an eighth as much.
inline constexpr Work kRestrict{25, 13.5, 27};
/// u + P v: read and write u, read an eighth as much.
inline constexpr Work kProlong{25, 25.5, 51};
/// As the operator; the rest positions join the linear modes.
inline constexpr Work kForce{330, 40, 64};
inline constexpr Work kDot{3, 24, 48};
inline constexpr Work kCombine{6, 36, 72};
/// Six scalars of a symmetric block.
inline constexpr Work kJacobi{15, 48, 96};
/// Beside product and preconditioner, one iteration of conjugate gradients: three scalar products
/// and three sums, each vector once.
inline constexpr Work kIteration{27, 84, 168};

}  // namespace counts
}  // namespace kerf::bench
