// SPDX-License-Identifier: MIT
//
// A device that is the host: memory of its own, filled with what is no number while it is fresh and
// after it is freed, and loops over the same bodies that threads of a GPU run. So all that a device
// backend does but the launches themselves is tested where there is no GPU: loads, stale data,
// copies of parts, recorded cycles, and, by the order of the threads, races.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <type_traits>
#include <vector>

#include "core/base/error.hpp"
#include "gpu/bodies/program.hpp"
#include "gpu/device_array.hpp"
#include "gpu/device_options.hpp"

namespace kerf::test {

/// In which order a launch runs its threads: a body that depends on it has a race.
enum class ThreadOrder { rising, falling, strided };

struct MirrorOptions {
  ThreadOrder order = ThreadOrder::rising;
  std::size_t memory = std::size_t{1} << 34;  ///< bytes; beyond, allocations fail
  std::size_t allocations = ~std::size_t{0};  ///< that succeed; all further ones fail
  gpu::DeviceOptions backend = {};
};

class MirrorDevice {
 public:
  static constexpr const char* kName = "mirror";
  struct Graph {
    std::vector<std::function<void()>> launches;
  };

  explicit MirrorDevice(const MirrorOptions& options = {}) : options_(options) {}
  ~MirrorDevice();
  MirrorDevice(const MirrorDevice&) = delete;
  MirrorDevice& operator=(const MirrorDevice&) = delete;

  void* allocate(std::size_t bytes);
  void release(void* at, std::size_t bytes) noexcept;
  void upload(void* to, const void* from, std::size_t bytes);
  void download(void* to, const void* from, std::size_t bytes);
  void copy(void* to, const void* from, std::size_t bytes);

  template <class Body>
  void launch(std::int32_t count, const Body& body) {
    static_assert(std::is_trivially_copyable_v<Body>, "a body is copied to the device as it is");
    ensures(count >= 0, "a launch of less than no threads");
    if (count == 0) return;
    submit([this, count, body] { each(count, body); });
  }
  template <class Body>
  void launch_blocks(std::int32_t blocks, const Body& body) {
    static_assert(std::is_trivially_copyable_v<Body>, "a body is copied to the device as it is");
    ensures(blocks >= 0, "a launch of less than no blocks");
    if (blocks == 0) return;
    submit([this, blocks, body] {
      each(blocks, [&](std::int32_t block) { run_block(block, body); });
    });
  }
  template <class List>
  void launch_program(const gpu::ProgramEntry* entries, std::int32_t n, std::int32_t) {
    submit([this, entries, n] {
      for (std::int32_t k = 0; k < n; ++k)
        gpu::visit_body(List{}, entries[k],
                        [&](const auto& body) { each(entries[k].count, body); });
    });
  }
  void begin_recording();
  Graph end_recording();
  void abandon_recording() noexcept { recording_ = false; }
  void replay(const Graph& graph);

  void wait() const {}
  gpu::DeviceCounters& counters() { return counters_; }

 private:
  template <class Body>
  void each(std::int32_t count, const Body& body) const {
    constexpr std::int32_t kStride = 7;
    if (options_.order == ThreadOrder::rising) {
      for (std::int32_t i = 0; i < count; ++i) body(i);
    } else if (options_.order == ThreadOrder::falling) {
      for (std::int32_t i = count - 1; i >= 0; --i) body(i);
    } else {
      for (std::int32_t first = 0; first < std::min(count, kStride); ++first)
        for (std::int32_t i = first; i < count; i += kStride) body(i);
    }
  }
  /// Shared memory is fresh; the threads of a phase run in any order.
  template <class Body>
  void run_block(std::int32_t block, const Body& body) const {
    const auto shared = std::make_unique<typename Body::Shared>();
    std::memset(static_cast<void*>(shared.get()), kPoison, sizeof *shared);
    std::vector<typename Body::State> states(Body::kThreads);
    for (std::int32_t phase = 0; phase < body.phases(block); ++phase)
      each(Body::kThreads, [&](std::int32_t thread) {
        body(phase, block, thread, *shared, states[static_cast<std::size_t>(thread)]);
      });
  }
  void submit(std::function<void()> launch);
  void expect_inside(const void* at, std::size_t bytes) const;

  static constexpr int kPoison = 0xff;  // NaN, and indices that lie outside

  MirrorOptions options_;
  gpu::DeviceCounters counters_;
  std::map<void*, std::size_t> held_;
  bool recording_ = false;
  Graph recorded_;
};

}  // namespace kerf::test
