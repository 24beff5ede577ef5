// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "bench/convergence/record.hpp"

namespace kerf::convergence {

/// The tables of docs/convergence.md, in its order.
std::string markdown_tables(const std::vector<Record>& records);

/// For each table that is a curve two panels: factor, and iterations of conjugate gradients.
/// @throws Error (bad_input) if there is nothing to plot.
std::string plot_svg(const std::vector<Record>& records);

}  // namespace kerf::convergence
