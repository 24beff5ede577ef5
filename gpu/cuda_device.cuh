// SPDX-License-Identifier: MIT
//
// One GPU as a device (device_array.hpp): one stream, plain memory, no managed one. Every call is
// checked. What a launch does is in bodies/; here are sizes of launches and no arithmetic.
#pragma once

#include <cooperative_groups.h>
#include <cuda_runtime.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include "gpu/bodies/program.hpp"
#include "gpu/device_array.hpp"

namespace kerf::gpu {

/// @throws Error (unavailable), OutOfMemory where it is that, which names the call, the size, the
/// device and what CUDA says.
void check(cudaError_t status, const char* call, int device, std::size_t size = 0);

inline constexpr int kThreads = 128;  // of a block

template <class Body>
__global__ void run_body(std::int32_t count, const Body body) {
  const std::int64_t i = static_cast<std::int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < count) body(static_cast<std::int32_t>(i));
}

/// A body of bodies/blocks.hpp, a block of threads a block.
template <class Body>
__global__ void __launch_bounds__(Body::kThreads, Body::kBlocksAtOnce) run_blocks(const Body body) {
  static_assert(sizeof(typename Body::Shared) <= std::size_t{48} << 10, "all that is static");
  __shared__ typename Body::Shared shared;
  typename Body::State state{};
  const auto block = static_cast<std::int32_t>(blockIdx.x);
  const std::int32_t phases = body.phases(block);
  for (std::int32_t phase = 0; phase < phases; ++phase) {
    body(phase, block, static_cast<int>(threadIdx.x), shared, state);
    __syncthreads();
  }
}

template <class F, class... Bodies>
__device__ void visit_on_device(BodyList<Bodies...>, const ProgramEntry& entry, const F& f) {
  int kind = 0;
  ((kind++ == entry.kind ? f(*reinterpret_cast<const Bodies*>(entry.body)) : void()), ...);
}

/// All indices of an entry, shared out over all threads.
struct EachIndex {
  std::int32_t count;

  template <class Body>
  __device__ void operator()(const Body& body) const {
    const std::int64_t stride = static_cast<std::int64_t>(gridDim.x) * blockDim.x;
    for (std::int64_t i = static_cast<std::int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
         i < count; i += stride)
      body(static_cast<std::int32_t>(i));
  }
};

template <class List>
__global__ void run_program(const ProgramEntry* entries, std::int32_t n) {
  for (std::int32_t k = 0; k < n; ++k) {
    visit_on_device(List{}, entries[k], EachIndex{entries[k].count});
    cooperative_groups::this_grid().sync();
  }
}

class CudaDevice {
 public:
  static constexpr const char* kName = "cuda";

  /// A recorded list of launches, ready to run.
  class Graph {
   public:
    Graph(cudaGraphExec_t handle, std::size_t launches) : handle_(handle), launches_(launches) {}
    ~Graph() {
      if (handle_ != nullptr) cudaGraphExecDestroy(handle_);
    }
    Graph(Graph&& other) noexcept
        : handle_(std::exchange(other.handle_, nullptr)), launches_(other.launches_) {}
    Graph& operator=(Graph&& other) noexcept {
      std::swap(handle_, other.handle_);
      std::swap(launches_, other.launches_);
      return *this;
    }
    cudaGraphExec_t get() const { return handle_; }
    std::size_t launches() const { return launches_; }

   private:
    cudaGraphExec_t handle_;
    std::size_t launches_;
  };

  explicit CudaDevice(int number);
  ~CudaDevice();
  CudaDevice(const CudaDevice&) = delete;
  CudaDevice& operator=(const CudaDevice&) = delete;

  void* allocate(std::size_t bytes);
  void release(void* at, std::size_t bytes) noexcept;
  void upload(void* to, const void* from, std::size_t bytes);
  void download(void* to, const void* from, std::size_t bytes);
  void copy(void* to, const void* from, std::size_t bytes);

  template <class Body>
  void launch(std::int32_t count, const Body& body) {
    static_assert(std::is_trivially_copyable_v<Body>, "a body is copied to the device as it is");
    if (count <= 0) return;
    use();
    const auto blocks =
        static_cast<unsigned>((static_cast<std::int64_t>(count) + kThreads - 1) / kThreads);
    run_body<<<blocks, kThreads, 0, stream_>>>(count, body);
    check(cudaGetLastError(), "a launch", number_, static_cast<std::size_t>(count));
    count_launch();
  }
  template <class Body>
  void launch_blocks(std::int32_t blocks, const Body& body) {
    static_assert(std::is_trivially_copyable_v<Body>, "a body is copied to the device as it is");
    if (blocks <= 0) return;
    use();
    run_blocks<<<static_cast<unsigned>(blocks), Body::kThreads, 0, stream_>>>(body);
    check(cudaGetLastError(), "a launch of blocks", number_, static_cast<std::size_t>(blocks));
    count_launch();
  }
  template <class List>
  void launch_program(const ProgramEntry* entries, std::int32_t n, std::int32_t count) {
    use();
    int resident = 0;
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&resident, run_program<List>, kThreads, 0),
          "cudaOccupancyMaxActiveBlocksPerMultiprocessor", number_);
    const std::int64_t wanted = (static_cast<std::int64_t>(count) + kThreads - 1) / kThreads;
    const std::int64_t most = static_cast<std::int64_t>(resident) * multiprocessors_;
    const auto blocks = static_cast<unsigned>(std::max<std::int64_t>(1, std::min(wanted, most)));
    void* arguments[] = {&entries, &n};
    check(cudaLaunchCooperativeKernel(reinterpret_cast<const void*>(&run_program<List>),
                                      dim3(blocks), dim3(kThreads), arguments, 0, stream_),
          "cudaLaunchCooperativeKernel", number_, static_cast<std::size_t>(count));
    count_launch();
  }

  void begin_recording();
  Graph end_recording();
  /// After an error between the two.
  void abandon_recording() noexcept;
  void replay(const Graph& graph);

  void wait() const;
  DeviceCounters& counters() { return counters_; }

 private:
  void use() const { check(cudaSetDevice(number_), "cudaSetDevice", number_); }
  void count_launch() {
    if (recording_) {
      ++recorded_;
      return;
    }
    ++counters_.calls;
    ++counters_.launches;
  }

  int number_;
  int multiprocessors_ = 0;
  cudaStream_t stream_ = nullptr;
  bool recording_ = false;
  std::size_t recorded_ = 0;  // launches
  DeviceCounters counters_;
};

}  // namespace kerf::gpu
