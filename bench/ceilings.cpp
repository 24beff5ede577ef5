// SPDX-License-Identifier: MIT
//
// bench/CMakeLists.txt lets this file alone contract a * b + c: there is no other way to ask the
// compiler for a fused multiply-add on a whole register. Its results are never looked at.
#include "bench/ceilings.hpp"

#include <algorithm>
#include <cstring>
#include <memory>

#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "gpu/cuda_backend.hpp"

namespace kerf::bench {
namespace {

#if defined(__AVX512F__)
constexpr int kRegisterBytes = 64;
#elif defined(__AVX__)
constexpr int kRegisterBytes = 32;
#else
constexpr int kRegisterBytes = 16;
#endif
// Latency 4, two units: eight chains keep them busy, twelve leave four registers for the rest.
constexpr int kChains = 12;
constexpr int kLaps = 10;

template <class T>
struct Pack;
template <>
struct Pack<float> {
  using Type __attribute__((vector_size(kRegisterBytes))) = float;
};
template <>
struct Pack<double> {
  using Type __attribute__((vector_size(kRegisterBytes))) = double;
};

// One thread's share. `sink` takes the sum, so that the loop is not in vain.
template <class T>
void fma_loop(long rounds, T& sink) {
  using Register = typename Pack<T>::Type;
  constexpr int kLanes = kRegisterBytes / static_cast<int>(sizeof(T));
  Register chain[kChains];
  for (int k = 0; k < kChains; ++k)
    for (int lane = 0; lane < kLanes; ++lane) chain[k][lane] = static_cast<T>(k + lane);
  Register factor, term;
  for (int lane = 0; lane < kLanes; ++lane) {
    factor[lane] = T(0.5);
    term[lane] = T(1);
  }
  for (long i = 0; i < rounds; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < kChains; ++k) chain[k] = chain[k] * factor + term;
  }
  for (int k = 1; k < kChains; ++k) chain[0] += chain[k];
  for (int lane = 0; lane < kLanes; ++lane) sink += chain[0][lane];
}

template <class T>
double run_fma(Ceiling& ceiling, long rounds) {
  const int threads = ceiling.threads;
  ceiling.items = static_cast<double>(rounds) * kChains * (kRegisterBytes / sizeof(T)) * threads;
  ceiling.giga = 2e-9 * ceiling.items;
  T sum = 0;
  double seconds = 1e30;
  // Several laps without letting the threads go: those that wake on one core need some
  // milliseconds to be moved apart.
#pragma omp parallel num_threads(threads) reduction(+ : sum)
  for (int lap = 0; lap < kLaps; ++lap) {
#pragma omp barrier
    const Timer timer;
    fma_loop(rounds, sum);
#pragma omp barrier
#pragma omp master
    seconds = std::min(seconds, timer.seconds());
  }
  ensures(sum > 0, "the loop of multiply-adds ran");
  return seconds;
}

// a = b + s c on arrays far larger than all caches; 24 bytes an element, as STREAM counts.
double run_triad(Ceiling& ceiling, std::size_t elements) {
  const int threads = ceiling.threads;
  const auto n = static_cast<long>(elements);
  const auto a = std::make_unique_for_overwrite<double[]>(elements);
  const auto b = std::make_unique_for_overwrite<double[]>(elements);
  const auto c = std::make_unique_for_overwrite<double[]>(elements);
  // Every thread touches its part first: its pages are then near it, and exist.
#pragma omp parallel for num_threads(threads) schedule(static)
  for (long i = 0; i < n; ++i) {
    a[i] = 0;
    b[i] = static_cast<double>(i);
    c[i] = 2;
  }
  ceiling.items = static_cast<double>(elements);
  ceiling.giga = 24e-9 * ceiling.items;
  const Timer timer;
#pragma omp parallel for num_threads(threads) schedule(static)
  for (long i = 0; i < n; ++i) a[i] = b[i] + 0.5 * c[i];
  const double seconds = timer.seconds();
  ensures(a[elements - 1] > 0, "the triad ran");
  return seconds;
}

}  // namespace

double Ceiling::best() const { return giga / *std::min_element(seconds.begin(), seconds.end()); }

Ceilings::Ceilings(const std::vector<int>& threads, bool small) : small_(small) {
  for (const int count : threads)
    for (const auto& [name, precision] :
         {std::pair{"triad", "double"}, {"fma-float", "single"}, {"fma-double", "double"}})
      all_.push_back({name, precision, count, 0, 0, {}, "machine"});
}

void Ceilings::measure() {
  const int runs = small_ ? 1 : 10;
  // Some 2 ms: on a shared machine, short enough that some run is not interrupted.
  const long rounds = small_ ? 1000 : 500'000;
  const std::size_t elements = std::size_t{1} << (small_ ? 12 : 23);
  for (int run = 0; run < runs; ++run)
    for (Ceiling& ceiling : all_) {
      double seconds = 0;
      if (std::strcmp(ceiling.name, "triad") == 0)
        seconds = run_triad(ceiling, elements);
      else if (std::strcmp(ceiling.name, "fma-float") == 0)
        seconds = run_fma<float>(ceiling, rounds);
      else
        seconds = run_fma<double>(ceiling, rounds);
      ceiling.seconds.push_back(seconds);
    }
}

void Ceilings::add_gpu() {
  if (!gpu_.empty()) return;
  const CudaCeilings found = measure_cuda_ceilings();
  const double flops = 2e-9 * found.multiply_adds;
  gpu_ = {
      {"triad", "double", 1, found.elements, 24e-9 * found.elements, {found.triad_seconds}, "cuda"},
      {"fma-float", "single", 1, found.multiply_adds, flops, {found.float_seconds}, "cuda"},
      {"fma-double", "double", 1, found.multiply_adds, flops, {found.double_seconds}, "cuda"}};
}

double Ceilings::best(const char* name, int threads, const std::string& machine) const {
  double out = 0;
  for (const Ceiling& ceiling : machine == "cuda" ? gpu_ : all_)
    if (ceiling.threads <= threads && std::strcmp(ceiling.name, name) == 0)
      out = std::max(out, ceiling.best());
  ensures(out > 0, "the ceilings of these threads were measured");
  return out;
}

}  // namespace kerf::bench
