// SPDX-License-Identifier: MIT
//
// The search for what a blade may meet, in patches.
#pragma once

#include <cstdint>
#include <span>

#include "core/levels/corners.hpp"
#include "cpu/patched_level.hpp"

namespace kerf::cpu {

/// As near_cells in core/levels/corners.hpp; the displacement in the order of the patches, m. Cells
/// of a patch are looked at only where its vertices reach into the box of the blade. Places are
/// rounded to single precision, so a few cells may be added that miss by no more than that.
NearCells find_near(const PatchedLevel& level, double spacing, std::span<const double> displacement,
                    const BladeReach& reach, std::span<const std::int32_t> opened, int threads);

}  // namespace kerf::cpu
