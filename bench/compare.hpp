// SPDX-License-Identifier: MIT
//
// Two backends side by side.
#pragma once

#include <string>
#include <vector>

#include "bench/csv.hpp"

namespace kerf::bench {

/// A line for each scene, phase and precision that both have, with the fastest run of each over all
/// numbers of threads, and how many times faster the second one is.
std::string comparison(const std::vector<Row>& rows, const std::string& first,
                       const std::string& second);

}  // namespace kerf::bench
