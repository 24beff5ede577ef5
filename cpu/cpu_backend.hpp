// SPDX-License-Identifier: MIT
//
// The reference backend: OpenMP loops over kernels/, double precision.
#pragma once

#include <memory>

#include "core/backend.hpp"

namespace kerf {

struct CpuOptions {
  int threads = 0;      ///< 0: all that OpenMP offers
  int tile_log2 = 0;    ///< cells interleaved in stored matrices: 1 << tile_log2 (0, 4 or 5)
  bool updates = true;  ///< false: loads anew after each cut, for comparison
};

/// The same bits for any number of threads and any tile.
std::unique_ptr<Backend> make_cpu_backend(const CpuOptions& options = {});

}  // namespace kerf
