// SPDX-License-Identifier: MIT
#include "tests/support/mirror_backend.hpp"

#include "gpu/make_device_backend.hpp"

namespace kerf::test {

std::unique_ptr<Backend> make_mirror_backend(bool single_cycle, const MirrorOptions& options) {
  auto device = std::make_unique<MirrorDevice>(options);
  if (single_cycle) return gpu::make_device_backend<float>(std::move(device), options.backend);
  return gpu::make_device_backend<double>(std::move(device), options.backend);
}

gpu::DeviceCounters& counters_of(Backend& mirror) {
  if (auto* single = dynamic_cast<gpu::DeviceBackend<MirrorDevice, float>*>(&mirror))
    return single->device().counters();
  return dynamic_cast<gpu::DeviceBackend<MirrorDevice, double>&>(mirror).device().counters();
}

}  // namespace kerf::test
