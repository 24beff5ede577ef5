// SPDX-License-Identifier: MIT
//
// Vectors whose memory lies in large pages, where there are some to be had.
#pragma once

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

namespace kerf {

/// Of all types.
inline std::atomic<unsigned> large_arrays_made{0};

/// Asks Linux for pages of 2 MB where an array fills some: the processor finds the addresses of
/// these in its tables, which pages of 4 KB overflow. What is left at the end has small pages; room
/// that is reserved and not used yet may be held up to the end of a page.
/// Arrays  start at different places within a page: the same places of arrays that are read
///         together would compete for the same lines of the caches.
template <class T>
struct LargePageAllocator {
  using value_type = T;

  LargePageAllocator() = default;
  template <class U>
  LargePageAllocator(const LargePageAllocator<U>&) noexcept {}

  T* allocate(std::size_t n) {
    if (n > (std::size_t(-1) - kPage) / sizeof(T)) throw std::bad_array_new_length();
    const std::size_t bytes = n * sizeof(T);
    if (!is_large(bytes)) return static_cast<T*>(::operator new(bytes));
    const std::size_t shift = large_arrays_made++ % kPlaces * kStep;
    auto* const page = static_cast<std::byte*>(::operator new(shift + bytes, kAlign));
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    madvise(page, (shift + bytes) / kPage * kPage, MADV_HUGEPAGE);  // may be refused
#endif
    return reinterpret_cast<T*>(page + shift);
  }
  void deallocate(T* memory, std::size_t n) noexcept {
    if (!is_large(n * sizeof(T))) return ::operator delete(memory);
    const auto at = reinterpret_cast<std::uintptr_t>(memory);
    ::operator delete(reinterpret_cast<void*>(at - at % kPage), kAlign);
  }
  template <class U>
  bool operator==(const LargePageAllocator<U>&) const noexcept {
    return true;
  }

 private:
  static constexpr std::size_t kPage = std::size_t{1} << 21;
  static constexpr std::align_val_t kAlign{kPage};
  static constexpr unsigned kPlaces = 16;
  static constexpr std::size_t kStep = 4096 + 5 * 64;
  static_assert(kPlaces * kStep < kPage && kStep % alignof(T) == 0);
  static bool is_large(std::size_t bytes) { return bytes >= kPage; }
};

/// An array that a pass over a body streams through.
template <class T>
using Array = std::vector<T, LargePageAllocator<T>>;

/// What an array holds. Room at its end that was never written takes no memory; what one had before
/// it became shorter is not counted.
template <class T, class Allocator>
std::size_t bytes_of(const std::vector<T, Allocator>& array) {
  return array.size() * sizeof(T);
}

}  // namespace kerf
