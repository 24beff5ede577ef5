// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

namespace kerf::gpu {

/// What is slower, for comparison.
struct DeviceOptions {
  bool updates = true;  ///< false: loads anew after each cut
  bool blocks = true;   ///< false: products of level 0 by records
  /// Records as well where more cells lie around a block of vertices; at most 8191.
  std::size_t most_block_cells = 8191;
};

}  // namespace kerf::gpu
