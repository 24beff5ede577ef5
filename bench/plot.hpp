// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/csv.hpp"

namespace kerf::bench {

/// A picture of a table: for each phase a panel, nanoseconds a cell against cells, both axes
/// logarithmic and the same in all panels; colours are candidates, shapes are scenes. Rows of scene
/// `machine` are left out.
/// @throws Error (bad_input) if nothing is left.
std::string plot_svg(const std::vector<Row>& rows);

/// @throws Error (bad_input) also if the file cannot be written.
void write_plot(const std::vector<Row>& rows, const std::filesystem::path& file);

}  // namespace kerf::bench
