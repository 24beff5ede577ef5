// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "core/base/workers.hpp"

namespace kerf::test {

/// A thread for each piece.
inline Workers thread_workers(int threads) {
  return {threads, [](int count, const Workers::Piece& piece) {
            std::exception_ptr error;
            std::mutex mutex;
            {
              std::vector<std::jthread> all;
              for (int n = 0; n < count; ++n)
                all.emplace_back([&, n] {
                  try {
                    piece(n);
                  } catch (...) {
                    const std::scoped_lock lock(mutex);
                    error = std::current_exception();
                  }
                });
            }
            if (error) std::rethrow_exception(error);
          }};
}

}  // namespace kerf::test
