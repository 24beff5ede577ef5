// SPDX-License-Identifier: MIT
//
// What a device can do at most: memory by a triad, arithmetic by fused multiply-adds in registers.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "gpu/cuda_backend.hpp"
#include "gpu/device_array.hpp"
#include "gpu/level_view.hpp"

namespace kerf::gpu {

/// a = b + s c; 24 bytes an element.
struct TriadBody {
  const double *b, *c;
  double* a;

  KERF_HD void operator()(std::int32_t i) const { a[i] = fma(0.5, c[i], b[i]); }
};

/// Chains that do not wait for each other; the sum is stored, so that they are not in vain.
template <class T>
struct FmaBody {
  static constexpr int kChains = 8;
  std::int32_t rounds;
  T* out;

  KERF_HD void operator()(std::int32_t i) const {
    T chain[kChains];
    for (int k = 0; k < kChains; ++k) chain[k] = static_cast<T>(i % 7 + k);
    for (std::int32_t round = 0; round < rounds; ++round)
      for (int k = 0; k < kChains; ++k) chain[k] = fma(chain[k], T(0.5), T(1));
    T sum = T(0);
    for (int k = 0; k < kChains; ++k) sum += chain[k];
    out[i] = sum;
  }
};

/// Seconds of the fastest of some launches.
template <class Device, class Body>
double least_seconds(Device& device, std::int32_t count, const Body& body) {
  constexpr int kRuns = 10;
  double least = 1e30;
  for (int run = 0; run <= kRuns; ++run) {
    device.wait();
    const auto begin = std::chrono::steady_clock::now();
    device.launch(count, body);
    device.wait();
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    if (run > 0) least = std::min(least, time.count());  // the first warms up
  }
  return least;
}

/// `elements` of the triad, threads and rounds of the multiply-adds.
template <class Device>
CudaCeilings measure_ceilings(Device& device, std::int32_t elements, std::int32_t threads,
                              std::int32_t rounds) {
  CudaCeilings out;
  const auto size = static_cast<std::size_t>(elements);
  DeviceArray<Device, double> a(device), b(device), c(device);
  a.assign(size);
  b.assign(size);
  c.assign(size);
  device.launch(elements, FmaBody<double>{1, b.data()});
  device.launch(elements, FmaBody<double>{2, c.data()});
  out.elements = static_cast<double>(elements);
  out.triad_seconds = least_seconds(device, elements, TriadBody{b.data(), c.data(), a.data()});
  out.multiply_adds = static_cast<double>(threads) * rounds * FmaBody<double>::kChains;
  DeviceArray<Device, double> sums(device);
  sums.assign(static_cast<std::size_t>(threads));
  out.double_seconds = least_seconds(device, threads, FmaBody<double>{rounds, sums.data()});
  out.float_seconds =
      least_seconds(device, threads, FmaBody<float>{rounds, reinterpret_cast<float*>(sums.data())});
  return out;
}

}  // namespace kerf::gpu
