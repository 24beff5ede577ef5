// SPDX-License-Identifier: MIT
//
// Threads that are lent to serial code.
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <functional>
#include <utility>

namespace kerf {

/// Runs pieces of work at once: whoever has threads, an OpenMP backend say, lends them. Without
/// any the pieces are run one after the other.
class Workers {
 public:
  using Piece = std::function<void(int)>;
  /// Calls piece(0) to piece(count - 1) in any order. When one throws, others may be left out, and
  /// it throws that.
  using Run = std::function<void(int count, const Piece& piece)>;

  Workers() = default;
  /// Needs  threads > 0; `run`, unless there is but one.
  Workers(int threads, Run run) : threads_(threads), run_(std::move(run)) {}

  /// In how many parts so much work is shared out: none of them is hardly worth a thread.
  std::size_t parts_of(std::size_t count) const {
    constexpr std::size_t kWorth = 1024;
    return std::clamp<std::size_t>(count / kWorth, 1, static_cast<std::size_t>(threads_));
  }
  /// body(part, begin, end) for each of them: equal parts of the numbers below `count`.
  template <class Body>
  void share(std::size_t count, const Body& body) const {
    const std::size_t parts = parts_of(count);
    if (parts == 1) return body(std::size_t{0}, std::size_t{0}, count);
    run_(static_cast<int>(parts), [&](int n) {
      const auto part = static_cast<std::size_t>(n);
      body(part, count * part / parts, count * (part + 1) / parts);
    });
  }
  /// Runs `aside` and `here` at once; without threads one after the other. Both have ended when
  /// this does, and what they throw is thrown by it: that of `here` if both do.
  ///
  /// Needs  that neither writes what the other reads.
  template <class Aside, class Here>
  void both(const Aside& aside, const Here& here) const {
    std::exception_ptr error[2];
    const auto piece = [&](int n) {
      try {
        if (n == 0)
          aside();
        else
          here();
      } catch (...) {
        error[n] = std::current_exception();
      }
    };
    if (threads_ > 1)
      run_(2, piece);
    else
      piece(0), piece(1);
    for (const int n : {1, 0})
      if (error[n]) std::rethrow_exception(error[n]);
  }

 private:
  int threads_ = 1;
  Run run_;
};

}  // namespace kerf
