// SPDX-License-Identifier: MIT
//
// Memory of a device that an object owns, and what a device must offer.
//
// A device is a class of its own and no interface, since launches are templates:
//
//   void* allocate(bytes)            throws OutOfMemory; the memory holds anything
//   void release(at, bytes) noexcept
//   void upload(to, from, bytes)     from the host; `from` may change as soon as this returns
//   void download(to, from, bytes)   to the host; waits for all that was asked for before
//   void copy(to, from, bytes)       on the device
//   void launch(count, body)         body(i) for i in [0, count), in any order or at once
//   void launch_blocks(blocks, body) a body of bodies/blocks.hpp
//   void launch_program<List>(entries, n, count)
//                                    the launches of bodies/program.hpp one after the other, in
//                                    one; `count` is the largest of them
//   void begin_recording()           from here on launches are noted down and do not run
//   Graph end_recording()
//   void abandon_recording() noexcept   after an error between the two
//   void replay(graph)               all noted launches in their order
//   void wait() const                all that was asked for is done
//   DeviceCounters& counters()
//
// All but download return early. What is asked for runs in its order. While it records, a device
// only launches. CudaDevice (cuda_device.cuh) is one; the tests have another, which is the host.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

#include "core/base/error.hpp"

namespace kerf::gpu {

/// What went on, since the device was made.
struct DeviceCounters {
  std::size_t calls = 0;       ///< launches that are not in a graph, and replays
  std::size_t launches = 0;    ///< all, in graphs too
  std::size_t replays = 0;     ///< of graphs
  std::size_t recordings = 0;  ///< of graphs
  std::size_t downloads = 0;   ///< each waits for the device
  std::size_t allocations = 0;
  std::size_t bytes_up = 0;    ///< from the host
  std::size_t bytes_down = 0;  ///< to the host
  std::size_t bytes_held = 0;  ///< now
  std::size_t bytes_most = 0;  ///< held at once
};

/// An array on a device. Grows geometrically, so that what cuts append seldom moves it.
template <class Device, class T>
class DeviceArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit DeviceArray(Device& device) : device_(&device) {}
  ~DeviceArray() { reset(); }
  DeviceArray(DeviceArray&& other) noexcept
      : device_(other.device_),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }

  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return capacity_; }

  void reset() noexcept {
    if (data_ != nullptr) device_->release(data_, capacity_ * sizeof(T));
    data_ = nullptr;
    size_ = capacity_ = 0;
  }

  /// Nothing is kept.
  void assign(std::size_t size) {
    if (size > capacity_) {
      std::size_t wanted = grown(size);
      reset();
      data_ = allocate(size, wanted);
      capacity_ = wanted;
    }
    size_ = size;
  }

  /// Room for so many. What was there is kept, also where there is no memory for more.
  void reserve(std::size_t size) {
    if (size <= capacity_) return;
    std::size_t wanted = grown(size);
    T* const moved = allocate(size, wanted);
    if (size_ > 0) device_->copy(moved, data_, size_ * sizeof(T));
    const std::size_t kept = size_;
    reset();
    data_ = moved;
    size_ = kept;
    capacity_ = wanted;
  }

  /// What was there is kept; what is new holds anything.
  void resize(std::size_t size) {
    reserve(size);
    size_ = size;
  }

  void upload(std::span<const T> values) {
    assign(values.size());
    write(0, values);
  }
  void write(std::size_t first, std::span<const T> values) {
    ensures(first + values.size() <= size_, "more is written to a device array than it holds");
    if (!values.empty()) device_->upload(data_ + first, values.data(), values.size_bytes());
  }
  void read(std::size_t first, std::span<T> values) const {
    ensures(first + values.size() <= size_, "more is read from a device array than it holds");
    if (!values.empty()) device_->download(values.data(), data_ + first, values.size_bytes());
  }

 private:
  // Without room to grow where there is no memory for it.
  T* allocate(std::size_t size, std::size_t& wanted) {
    if (wanted > size) {
      try {
        return static_cast<T*>(device_->allocate(wanted * sizeof(T)));
      } catch (const OutOfMemory&) {
        wanted = size;
      }
    }
    return static_cast<T*>(device_->allocate(size * sizeof(T)));
  }
  // The first time exactly, then by a quarter at least; memory of a device is dear.
  std::size_t grown(std::size_t size) const {
    return capacity_ == 0 ? size : std::max(size, capacity_ + capacity_ / 4);
  }

  Device* device_;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace kerf::gpu
