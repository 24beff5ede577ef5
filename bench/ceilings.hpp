// SPDX-License-Identifier: MIT
//
// What this machine can do at most, measured beside the phases: memory by a triad, arithmetic by a
// loop of fused multiply-adds in registers.
#pragma once

#include <string>
#include <vector>

namespace kerf::bench {

/// Runs of one ceiling with one number of threads.
struct Ceiling {
  const char* name;       ///< triad, fma-float, fma-double
  const char* precision;  ///< of its numbers: single or double
  int threads = 1;
  double items = 0;  ///< elements of the triad, fused multiply-adds; a run
  double giga = 0;   ///< a run: GB moved, or GFLOP
  std::vector<double> seconds;
  std::string machine = "machine";  ///< or "cuda": the GPU

  double best() const;  ///< GB/s or GFLOP/s of the fastest run
};

/// `small`: too short for numbers that mean something, long enough for a test.
class Ceilings {
 public:
  Ceilings(const std::vector<int>& threads, bool small);

  /// Some more runs of each; the best of all calls count.
  void measure();
  /// Those of the GPU, once. @throws Error (unavailable) where there is none.
  void add_gpu();

  const std::vector<Ceiling>& all() const { return all_; }
  const std::vector<Ceiling>& gpu() const { return gpu_; }
  // The best with so many threads or fewer: on a shared machine more of them may measure less.
  double bytes_per_second(int threads, const std::string& machine = "machine") const {
    return 1e9 * best("triad", threads, machine);
  }
  /// Instructions on single numbers: a fused multiply-add is one here, and two FLOP in the table.
  double slots_per_second(int threads, bool in_single,
                          const std::string& machine = "machine") const {
    return 0.5e9 * best(in_single ? "fma-float" : "fma-double", threads, machine);
  }

 private:
  double best(const char* name, int threads, const std::string& machine) const;

  bool small_;
  std::vector<Ceiling> all_, gpu_;
};

}  // namespace kerf::bench
