// SPDX-License-Identifier: MIT
#pragma once

#include <span>

namespace kerf {

/// Raises the eigenvalues of a cell matrix that rounding has made negative, in place.
///
/// Where a few fine cells lie in a corner of a large coarse cell, its far vertices hardly move
/// them, so that their true entries are below the rounding of the greatest one. A matrix that is
/// definite but for `rounding` keeps its bits; in another, eigenvalues below `rounding` times the
/// greatest magnitude are set to that.
///
/// @throws Error (bad_input) if an entry is not finite.
///
/// Shapes  packed: the lower triangle of the 24 x 24, 300 entries (kernels/layout.hpp)
void make_definite(std::span<double> packed, double rounding);

}  // namespace kerf
