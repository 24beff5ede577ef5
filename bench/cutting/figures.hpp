// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/cutting/record.hpp"

namespace kerf::cutting {

/// A Markdown table for each scene, and one of the octree against the uniform grid.
std::string markdown_tables(const std::vector<Record>& records);

/// For each scene two panels, logarithmic: the error against cells and against seconds, a line for
/// each method.
std::string plot_svg(const std::vector<Record>& records);
/// @throws Error (bad_input) if the file cannot be written.
void write_plot(const std::vector<Record>& records, const std::filesystem::path& file);

}  // namespace kerf::cutting
