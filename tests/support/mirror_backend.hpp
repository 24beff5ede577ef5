// SPDX-License-Identifier: MIT
//
// The backend of a device, on the mirror (mirror_device.hpp). Compiled once for all tests.
#pragma once

#include <memory>

#include "core/backend.hpp"
#include "gpu/device_array.hpp"
#include "tests/support/mirror_device.hpp"

namespace kerf::test {

std::unique_ptr<Backend> make_mirror_backend(bool single_cycle, const MirrorOptions& options = {});

/// What a backend of make_mirror_backend did so far.
gpu::DeviceCounters& counters_of(Backend& mirror);

}  // namespace kerf::test
