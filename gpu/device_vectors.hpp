// SPDX-License-Identifier: MIT
//
// Vectors of a device backend, and sums over them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "gpu/device_backend.hpp"

namespace kerf::gpu {

template <class Device, class S>
DeviceWork DeviceBackend<Device, S>::device_work() const {
  const DeviceCounters& c = device_->counters();
  return {c.calls, c.launches, c.bytes_up, c.bytes_down};
}

/// body(from, to) with the types that two vectors have.
template <class Device, class S>
template <class Body>
void DeviceBackend<Device, S>::with(int level, int x, int y, const Body& body) const {
  vector_at(level, x).with(
      [&](const auto* from) { vector_at(level, y).with([&](auto* to) { body(from, to); }); });
}

/// The sums of terms.add(i), handed to `then` on the device.
template <class Device, class S>
template <class Terms, class Then>
void DeviceBackend<Device, S>::sum(std::int32_t size, const Terms& terms, const Then& then) const {
  const std::int32_t lanes = size < kWorthLanes ? kLastLanes : kManyLanes;
  double* const part = partial_.data();
  run(lanes, PartialSums<Terms>{terms, size, lanes, part});
  if (lanes == kLastLanes) {
    run(1, TotalSums<Terms::kSums, Then>{lanes, part, then});
    return;
  }
  double* const folded = part + at(kMostSums) * at(kManyLanes);
  run(Terms::kSums * kLastLanes, FoldSums{lanes, part, folded});
  run(1, TotalSums<Terms::kSums, Then>{kLastLanes, folded, then});
}

template <class Device, class S>
template <std::size_t sums>
std::array<double, sums> DeviceBackend<Device, S>::read_sums() const {
  std::array<double, sums> out;
  totals_.read(0, out);
  return out;
}

template <class Device, class S>
double DeviceBackend<Device, S>::dot(int level, int x, int y) {
  const std::int32_t size = level_at(level).scalars();
  with(level, x, y, [&](const auto* a, const auto* b) {
    sum(size, DotTerms<std::decay_t<decltype(*a)>, std::decay_t<decltype(*b)>>{a, b},
        StoreSums<1>{totals_.data()});
  });
  return read_sums<1>()[0];
}

/// In double, rounded in the end. What is summed is the residual as it is stored.
template <class Device, class S>
double DeviceBackend<Device, S>::true_residual(int b, int x, int r) {
  multiply<double>(0, exact_vector(x), ResidualTo<double, S>{exact_vector(b), cycle_vector(0, r)});
  return std::sqrt(dot(0, r, r));
}

template <class Device, class S>
std::array<double, 2> DeviceBackend<Device, S>::dots(int x, int y, int z) {
  sum(level_at(0).scalars(),
      TwoDotTerms<S, S>{cycle_vector(0, x), cycle_vector(0, y), cycle_vector(0, z)},
      StoreSums<2>{totals_.data()});
  return read_sums<2>();
}

/// The numbers of the step stay on the device; they come back once, behind it. The product is that
/// of the direction as it is stored, in double, and rounded only in the end: its error is then
/// relative to itself, and does not grow with the condition of the matrix.
template <class Device, class S>
bool DeviceBackend<Device, S>::advance_conjugate(int z, int d, int q, int x, int r,
                                                 ConjugateState& state) {
  const std::int32_t size = level_at(0).scalars();
  ConjugateScalars* const s = conjugate_.data();
  const S* const from = cycle_vector(0, z);
  S *direction = cycle_vector(0, d), *product = cycle_vector(0, q), *left = cycle_vector(0, r);
  sum(size, TwoDotTerms<S, S>{from, left, product}, ConjugateDirection{s, state.first});
  run(size, CombineBody<S, S, double>{{1}, {0, &s->beta}, from, direction});
  gather_finest<double>(FinestCells<double, S>{finest_view<double>(scales_.data()), direction},
                        SumTo<double, S>{product, true});
  sum(size, TwoDotTerms<S, S>{direction, product, left}, ConjugateStep{s});
  sum(size, AdvanceTerms<S>{{0, &s->alpha}, direction, product, exact_vector(x), left},
      StoreSums<1>{&s->residual2});
  ConjugateScalars out;
  conjugate_.read(0, {&out, 1});
  state = {out.rho, out.alpha, out.residual2, false};
  return out.is_valid != 0;
}

template <class Device, class S>
void DeviceBackend<Device, S>::zero(int level, int x) {
  const std::int32_t size = level_at(level).scalars();
  if (has_vector(level, x))
    vector_at(level, x).with(
        [&](auto* to) { run(size, ZeroBody<std::decay_t<decltype(*to)>>{to}); });
  if (x == kSolution) level_at(level).solution_is_zero = true;
}

/// Those of VectorId stay, since a recorded cycle may use them.
template <class Device, class S>
void DeviceBackend<Device, S>::release(int x) {
  if (x < kLevelVectors)
    zero(0, x);
  else if (!levels_.empty())
    levels_[0].vectors[at(x)].reset();
}

template <class Device, class S>
void DeviceBackend<Device, S>::copy(int level, int from, int to) {
  const std::int32_t size = level_at(level).scalars();
  with(level, from, to, [&](const auto* a, auto* b) {
    run(size, CopyBody<std::decay_t<decltype(*a)>, std::decay_t<decltype(*b)>>{a, b});
  });
  changed(level, to);
}

template <class Device, class S>
void DeviceBackend<Device, S>::combine(int level, double a, int x, double b, int y) {
  const std::int32_t size = level_at(level).scalars();
  with(level, x, y, [&](const auto* from, auto* to) {
    run(size, CombineBody<std::decay_t<decltype(*from)>, std::decay_t<decltype(*to)>>{
                  {a}, {b}, from, to});
  });
  changed(level, y);
}

template <class Device, class S>
void DeviceBackend<Device, S>::mask(int level, int x) {
  const LevelView view = level_at(level).view();
  vector_at(level, x).with([&](auto* to) {
    run(view.vertices, MaskBody<std::decay_t<decltype(*to)>>{view.fixed, to});
  });
  changed(level, x);
}

template <class Device, class S>
void DeviceBackend<Device, S>::write(int level, int x, std::span<const double> values) {
  const Vector& vector = vector_at(level, x);
  expects(values.size() == vector.size(), "write: three values per vertex of the level");
  if (vector.is_exact) {
    device_->upload(vector.doubled.data(), values.data(), values.size_bytes());
  } else {
    std::vector<S> rounded;
    rounded.reserve(values.size());
    for (const double value : values) rounded.push_back(static_cast<S>(value));
    device_->upload(vector.single.data(), rounded.data(), rounded.size() * sizeof(S));
  }
  changed(level, x);
}

template <class Device, class S>
void DeviceBackend<Device, S>::read(int level, int x, std::span<double> values) const {
  const Vector& vector = levels_[at(level)].vectors[at(x)];
  expects(vector.size() == 0 || values.size() == vector.size(),
          "read: three values per vertex of the level");
  if (vector.size() == 0) {
    std::fill(values.begin(), values.end(), 0.0);
  } else if (vector.is_exact) {
    vector.doubled.read(0, values);
  } else {
    std::vector<S> rounded(values.size());
    vector.single.read(0, rounded);
    std::copy(rounded.begin(), rounded.end(), values.begin());
  }
}

template <class Device, class S>
void DeviceBackend<Device, S>::write_noise(int level, int x, std::size_t size) {
  vector_at(level, x).with([&](auto* to) {
    run(static_cast<std::int32_t>(size), NoiseBody<std::decay_t<decltype(*to)>>{to});
  });
  changed(level, x);
}

template <class Device, class S>
void DeviceBackend<Device, S>::write_some(int level, int x, std::span<const std::int32_t> vertices,
                                          std::span<const double> values) {
  const std::int32_t* const numbers = staging_.put(vertices);
  const double* const from = other_staging_.put(values);
  vector_at(level, x).with([&](auto* to) {
    run(count_of(values), ScatterBody<std::decay_t<decltype(*to)>>{numbers, from, to});
  });
  changed(level, x);
}

template <class Device, class S>
void DeviceBackend<Device, S>::read_some(int level, int x, std::span<const std::int32_t> vertices,
                                         std::span<double> values) const {
  const std::int32_t* const numbers = staging_.put(vertices);
  values_.assign(values.size());
  vector_at(level, x).with([&](const auto* from) {
    run(count_of(values), GatherBody<std::decay_t<decltype(*from)>>{numbers, from, values_.data()});
  });
  values_.read(0, values);
}

}  // namespace kerf::gpu
