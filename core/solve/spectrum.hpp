// SPDX-License-Identifier: MIT
//
// The upper end of the spectrum of D^-1 A, which Chebyshev smoothing needs.
#pragma once

#include "core/backend.hpp"

namespace kerf {

/// An estimate from above of max eig(D^-1 A) on one level: the largest Ritz value of a few Lanczos
/// steps, with a margin. Deterministic. Overwrites all vectors that every level has. Needs the
/// diagonal blocks of the level.
/// Source  Saad 2003 [S03], 6.7.3: the Lanczos matrix from the coefficients of conjugate gradients.
double estimate_spectral_bound(Backend& backend, int level, const Level& structure);

}  // namespace kerf
