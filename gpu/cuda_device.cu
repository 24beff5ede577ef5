// SPDX-License-Identifier: MIT
#include "gpu/cuda_device.cuh"

namespace kerf::gpu {
namespace {

std::string device_name(int number) {
  cudaDeviceProp properties{};
  if (cudaGetDeviceProperties(&properties, number) != cudaSuccess) return "unknown";
  return properties.name;
}

}  // namespace

void check(cudaError_t status, const char* call, int device, std::size_t size) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // or the next launch would report it again
  const std::string what =
      text("CUDA: ", call, size > 0 ? text(" of size ", size) : std::string(), " failed on device ",
           device, " (", device_name(device), "): ", cudaGetErrorString(status));
  if (status == cudaErrorMemoryAllocation)
    throw OutOfMemory(what +
                      "; lower body.resolution or solver.coarsest_vertices, or set "
                      "solver.backend = \"cpu\"");
  throw Error(ErrorKind::unavailable, what);
}

CudaDevice::CudaDevice(int number) : number_(number) {
  use();
  check(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, number_),
        "cudaDeviceGetAttribute", number_);
  check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "cudaStreamCreateWithFlags",
        number_);
}

CudaDevice::~CudaDevice() {
  if (stream_ == nullptr) return;
  cudaSetDevice(number_);
  cudaStreamSynchronize(stream_);
  cudaStreamDestroy(stream_);
}

void* CudaDevice::allocate(std::size_t bytes) {
  ensures(!recording_, "memory is allocated while a graph is recorded");
  use();
  void* at = nullptr;
  check(cudaMalloc(&at, std::max<std::size_t>(bytes, 1)), "cudaMalloc", number_, bytes);
  ++counters_.allocations;
  counters_.bytes_held += bytes;
  counters_.bytes_most = std::max(counters_.bytes_most, counters_.bytes_held);
  return at;
}

// Waits for what was asked for before: cudaFree does.
void CudaDevice::release(void* at, std::size_t bytes) noexcept {
  cudaSetDevice(number_);
  cudaFree(at);
  counters_.bytes_held -= bytes;
}

// From memory that is not pinned: the call returns when the driver has its own copy.
void CudaDevice::upload(void* to, const void* from, std::size_t bytes) {
  ensures(!recording_, "a copy is asked for while a graph is recorded");
  use();
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream_),
        "cudaMemcpyAsync to the device", number_, bytes);
  counters_.bytes_up += bytes;
}

void CudaDevice::download(void* to, const void* from, std::size_t bytes) {
  ensures(!recording_, "a copy is asked for while a graph is recorded");
  use();
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_),
        "cudaMemcpyAsync to the host", number_, bytes);
  check(cudaStreamSynchronize(stream_), "cudaStreamSynchronize", number_);
  ++counters_.downloads;
  counters_.bytes_down += bytes;
}

void CudaDevice::copy(void* to, const void* from, std::size_t bytes) {
  ensures(!recording_, "a copy is asked for while a graph is recorded");
  use();
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, stream_),
        "cudaMemcpyAsync on the device", number_, bytes);
}

void CudaDevice::begin_recording() {
  ensures(!recording_, "a graph is recorded inside another");
  use();
  check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "cudaStreamBeginCapture",
        number_);
  recording_ = true;
  recorded_ = 0;
}

CudaDevice::Graph CudaDevice::end_recording() {
  recording_ = false;
  cudaGraph_t graph = nullptr;
  check(cudaStreamEndCapture(stream_, &graph), "cudaStreamEndCapture", number_);
  cudaGraphExec_t handle = nullptr;
  const cudaError_t status = cudaGraphInstantiate(&handle, graph, 0);
  cudaGraphDestroy(graph);
  check(status, "cudaGraphInstantiate", number_);
  ++counters_.recordings;
  return Graph(handle, recorded_);
}

void CudaDevice::abandon_recording() noexcept {
  recording_ = false;
  cudaGraph_t graph = nullptr;
  cudaStreamEndCapture(stream_, &graph);
  if (graph != nullptr) cudaGraphDestroy(graph);
  cudaGetLastError();
}

void CudaDevice::replay(const Graph& graph) {
  use();
  check(cudaGraphLaunch(graph.get(), stream_), "cudaGraphLaunch", number_);
  ++counters_.replays;
  ++counters_.calls;
  counters_.launches += graph.launches();
}

void CudaDevice::wait() const {
  use();
  check(cudaStreamSynchronize(stream_), "cudaStreamSynchronize", number_);
}

}  // namespace kerf::gpu
