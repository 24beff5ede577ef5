// SPDX-License-Identifier: MIT
//
// The search for what a blade may meet, for the reference backend.
#pragma once

#include <cstdint>
#include <span>

#include "core/levels/corners.hpp"

namespace kerf::cpu {

/// As near_cells in core/levels/corners.hpp, on several threads.
NearCells find_near(const Hierarchy& hierarchy, std::span<const double> displacement,
                    const BladeReach& reach, std::span<const std::int32_t> opened, int threads);

}  // namespace kerf::cpu
