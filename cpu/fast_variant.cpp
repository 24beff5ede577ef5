// SPDX-License-Identifier: MIT
#include "cpu/fast_variant.hpp"

#include <memory>

#include "cpu/fast_state.hpp"

#ifndef KERF_FAST_FACTORY  // the flags of the tree: all there is, or the lowest of several
#define KERF_FAST_FACTORY kerf_fast_baseline
#endif

kerf::Backend* KERF_FAST_FACTORY(const kerf::FastOptions& options) {
  using kerf::cpu::FastBackend;
  if (options.single_cycle)
    return std::make_unique<FastBackend<float>>(options.threads, options.updates).release();
  return std::make_unique<FastBackend<double>>(options.threads, options.updates).release();
}
