// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "bench/chart.hpp"
#include "bench/papers/results.hpp"

namespace kerf::papers {

/// A table for each experiment, the paper's figures beside ours, and one of criteria.
std::string markdown(const Results& results);

bench::Chart figure10_chart(const Results& results);
bench::Chart figure12_chart(const Results& results);
/// Seconds of a step over cells, of table 1.
bench::Chart cost_chart(const Results& results);

/// papers.md, and an SVG for each chart that has something to show.
/// @throws Error (bad_input) if a file cannot be written.
void write_report(const std::filesystem::path& folder, const Results& results);

}  // namespace kerf::papers
