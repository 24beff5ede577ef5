// SPDX-License-Identifier: MIT
//
// A backend on a device, with all its parts.
#pragma once

#include <memory>
#include <utility>

#include "gpu/device_cycle.hpp"
#include "gpu/device_near.hpp"
#include "gpu/device_surface.hpp"
#include "gpu/device_values.hpp"
#include "gpu/device_vectors.hpp"

namespace kerf::gpu {

/// S: scalar of the cycle.
template <class S, class Device>
std::unique_ptr<DeviceBackend<Device, S>> make_device_backend(std::unique_ptr<Device> device,
                                                              const DeviceOptions& options = {}) {
  return std::make_unique<DeviceBackend<Device, S>>(std::move(device), options);
}

}  // namespace kerf::gpu
