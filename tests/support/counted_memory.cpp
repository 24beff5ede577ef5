// SPDX-License-Identifier: MIT
#include "tests/support/counted_memory.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace {

std::atomic<bool> counting = false;
std::atomic<std::size_t> allocated = 0;

void* allocate(std::size_t size, std::size_t unit) {
  if (size > SIZE_MAX - unit) throw std::bad_alloc();
  size = std::max<std::size_t>(size, 1);
  if (counting) allocated += size;
  void* const out = std::aligned_alloc(unit, (size + unit - 1) / unit * unit);
  if (out == nullptr) throw std::bad_alloc();
  return out;
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t align) {
  return allocate(size, static_cast<std::size_t>(align));
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace kerf::test {

void count_allocations() {
  allocated = 0;
  counting = true;
}

std::size_t allocated_bytes() {
  counting = false;
  return allocated;
}

}  // namespace kerf::test
