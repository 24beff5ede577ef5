// SPDX-License-Identifier: MIT
#include "tests/support/mirror_device.hpp"

#include <cstdlib>
#include <cstring>
#include <utility>

namespace kerf::test {

MirrorDevice::~MirrorDevice() {
  for (const auto& [at, bytes] : held_) std::free(at);
}

void* MirrorDevice::allocate(std::size_t bytes) {
  ensures(!recording_, "memory is allocated while a graph is recorded");
  if (counters_.bytes_held + bytes > options_.memory ||
      counters_.allocations == options_.allocations)
    throw OutOfMemory(text("the mirror has no ", bytes, " bytes left"));
  void* const at = std::malloc(std::max<std::size_t>(bytes, 1));
  std::memset(at, kPoison, bytes);
  held_[at] = bytes;
  ++counters_.allocations;
  counters_.bytes_held += bytes;
  counters_.bytes_most = std::max(counters_.bytes_most, counters_.bytes_held);
  return at;
}

void MirrorDevice::release(void* at, std::size_t bytes) noexcept {
  held_.erase(at);
  counters_.bytes_held -= bytes;
  std::memset(at, kPoison, bytes);
  std::free(at);
}

void MirrorDevice::upload(void* to, const void* from, std::size_t bytes) {
  expect_inside(to, bytes);
  counters_.bytes_up += bytes;
  std::memcpy(to, from, bytes);
}

void MirrorDevice::download(void* to, const void* from, std::size_t bytes) {
  expect_inside(from, bytes);
  ++counters_.downloads;
  counters_.bytes_down += bytes;
  std::memcpy(to, from, bytes);
}

void MirrorDevice::copy(void* to, const void* from, std::size_t bytes) {
  expect_inside(to, bytes);
  expect_inside(from, bytes);
  std::memmove(to, from, bytes);
}

void MirrorDevice::begin_recording() {
  ensures(!recording_, "a graph is recorded inside another");
  recording_ = true;
  recorded_ = {};
}

MirrorDevice::Graph MirrorDevice::end_recording() {
  recording_ = false;
  ++counters_.recordings;
  return std::move(recorded_);
}

void MirrorDevice::replay(const Graph& graph) {
  ensures(!recording_, "a graph is replayed while another is recorded");
  ++counters_.replays;
  ++counters_.calls;
  counters_.launches += graph.launches.size();
  for (const auto& launch : graph.launches) launch();
}

void MirrorDevice::submit(std::function<void()> launch) {
  if (recording_) {
    recorded_.launches.push_back(std::move(launch));
    return;
  }
  ++counters_.calls;
  ++counters_.launches;
  launch();
}

// Copies stay inside what was allocated, and are not recorded.
void MirrorDevice::expect_inside(const void* at, std::size_t bytes) const {
  ensures(!recording_, "a copy is asked for while a graph is recorded");
  auto block = held_.upper_bound(const_cast<void*>(at));
  ensures(block != held_.begin(), "a copy outside the memory of the device");
  --block;
  const auto first = static_cast<std::size_t>(static_cast<const char*>(at) -
                                              static_cast<const char*>(block->first));
  ensures(first + bytes <= block->second, "a copy beyond the memory of the device");
}

}  // namespace kerf::test
