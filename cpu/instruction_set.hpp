// SPDX-License-Identifier: MIT
#pragma once

#include "kernels/host_device.hpp"

namespace kerf::cpu {

/// What the file that reads this is compiled for. Not `inline`: in a build for distribution it
/// differs from file to file.
constexpr const char* kInstructionSet = KERF_PACK_BITS == 512   ? "avx512"
                                        : KERF_PACK_BITS == 256 ? "avx2"
                                                                : "baseline";

}  // namespace kerf::cpu
