// SPDX-License-Identifier: MIT
//
// Loops on some threads, and exceptions out of them, which must not leave them by themselves.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>

#include "core/base/workers.hpp"
#include "cpu/flush.hpp"

namespace kerf::cpu {

/// Keeps what the first of some parts threw, on whatever thread. The others are then left out: what
/// a thread keeps from one to the next may be unfinished.
class ParallelErrors {
 public:
  template <class Part>
  void run(const Part& part) noexcept {
    if (failed_) return;
    try {
      part();
    } catch (...) {
      if (!failed_.exchange(true)) error_ = std::current_exception();
    }
  }
  /// After the region: throws it, if there is one.
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::atomic<bool> failed_ = false;
  std::exception_ptr error_;
};

/// Runs body(i) for i from begin to end on some threads. What they throw, one of them at least, is
/// thrown here.
template <class Body>
void for_parts(std::int32_t begin, std::int32_t end, int threads, const Body& body) {
  ParallelErrors errors;
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1) if (end - begin > 1)
  for (std::int32_t i = begin; i < end; ++i) errors.run([&] { body(i); });
  errors.rethrow();
}

/// The same for the arithmetic of elements.
template <class Body>
void for_patches(std::int32_t begin, std::int32_t end, int threads, const Body& body) {
  for_parts(begin, end, threads, [&](std::int32_t i) {
    const FlushToZero flush;
    body(i);
  });
}

/// Those of OpenMP for work of the host. Threads of its own would share processors with these,
/// which look for more work for some milliseconds before they sleep.
inline Workers workers_of(int threads) {
  return {threads, [threads](int count, const Workers::Piece& piece) {
            for_parts(0, count, threads, piece);
          }};
}

}  // namespace kerf::cpu
