// SPDX-License-Identifier: MIT
//
// Memory, launches and sums of a device, on the mirror.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include "gpu/bodies/dense.hpp"
#include "gpu/bodies/vectors.hpp"
#include "gpu/device_array.hpp"
#include "gpu/device_ceilings.hpp"
#include "tests/support/mirror_device.hpp"

namespace kerf {
namespace {

using gpu::DeviceArray;
using test::MirrorDevice;
using test::MirrorOptions;
using test::ThreadOrder;

template <class T>
std::vector<T> read(const DeviceArray<MirrorDevice, T>& array) {
  std::vector<T> out(array.size());
  array.read(0, out);
  return out;
}

TEST(DeviceArray, KeepsWhatItHoldsAndGrowsGeometrically) {
  MirrorDevice device;
  DeviceArray<MirrorDevice, int> array(device);
  array.upload(std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8});
  EXPECT_EQ(array.capacity(), 8u);  // the first time exactly

  array.resize(9);
  EXPECT_EQ(array.capacity(), 10u);
  array.write(8, std::vector<int>{9});

  EXPECT_EQ(read(array), (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  array.resize(2);
  EXPECT_EQ(read(array), (std::vector<int>{1, 2}));
  EXPECT_EQ(device.counters().bytes_held, 10 * sizeof(int));
  EXPECT_EQ(device.counters().bytes_most, 18 * sizeof(int));
}

TEST(DeviceArray, GivesItsMemoryBack) {
  MirrorDevice device;
  {
    DeviceArray<MirrorDevice, double> a(device), b(device);
    a.assign(7);
    b = std::move(a);
    EXPECT_EQ(b.size(), 7u);
    EXPECT_EQ(device.counters().bytes_held, 7 * sizeof(double));
  }
  EXPECT_EQ(device.counters().bytes_held, 0u);
}

TEST(DeviceArray, CopiesBeyondItsEndAreErrors) {
  MirrorDevice device;
  DeviceArray<MirrorDevice, int> array(device);
  array.assign(3);
  std::vector<int> out(2);

  EXPECT_THROW(array.write(2, std::vector<int>{1, 2}), Error);
  EXPECT_THROW(array.read(2, out), Error);
}

TEST(MirrorDevice, FreshMemoryIsNoNumber) {
  MirrorDevice device;
  DeviceArray<MirrorDevice, double> array(device);
  array.assign(3);
  for (const double x : read(array)) EXPECT_TRUE(std::isnan(x));
}

TEST(MirrorDevice, RunsOutOfMemory) {
  MirrorDevice device({ThreadOrder::rising, 100});
  DeviceArray<MirrorDevice, double> array(device);
  try {
    array.assign(13);
    FAIL() << "104 bytes of 100";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
  }
  array.assign(12);  // nothing is lost
}

TEST(MirrorDevice, RecordedLaunchesRunWhenTheyAreReplayed) {
  MirrorDevice device;
  DeviceArray<MirrorDevice, double> x(device), y(device), other(device);
  x.upload(std::vector<double>{1, 2});
  y.upload(std::vector<double>{10, 20});
  device.begin_recording();
  device.launch(2, gpu::CombineBody<double, double>{{2}, {1}, x.data(), y.data()});
  EXPECT_THROW(other.assign(1), Error) << "memory of a recorded launch might move";
  EXPECT_THROW(x.write(0, std::vector<double>{7}), Error) << "a copy is not repeated";
  const auto graph = device.end_recording();
  EXPECT_EQ(read(y), (std::vector<double>{10, 20}));

  device.replay(graph);
  device.replay(graph);

  EXPECT_EQ(read(y), (std::vector<double>{14, 28}));
  EXPECT_EQ(device.counters().launches, 2u);
  EXPECT_EQ(device.counters().calls, 2u);
  EXPECT_EQ(device.counters().replays, 2u);
}

/// x.y and x.z by all three passes of a sum.
std::vector<double> sums_of(const std::vector<float>& x, const std::vector<double>& y,
                            const std::vector<double>& z, std::int32_t lanes, ThreadOrder order) {
  MirrorDevice device({order});
  DeviceArray<MirrorDevice, float> dx(device);
  DeviceArray<MirrorDevice, double> dy(device), dz(device), part(device), folded(device),
      out(device);
  dx.upload(x);
  dy.upload(y);
  dz.upload(z);
  part.assign(2 * static_cast<std::size_t>(lanes));
  folded.assign(2 * gpu::kLastLanes);
  out.assign(2);
  using Terms = gpu::TwoDotTerms<float, double>;
  const auto size = static_cast<std::int32_t>(x.size());
  device.launch(
      lanes, gpu::PartialSums<Terms>{{dx.data(), dy.data(), dz.data()}, size, lanes, part.data()});
  device.launch(2 * gpu::kLastLanes, gpu::FoldSums{lanes, part.data(), folded.data()});
  device.launch(1,
                gpu::TotalSums<2, gpu::StoreSums<2>>{gpu::kLastLanes, folded.data(), {out.data()}});
  return read(out);
}

TEST(Sums, AreRightAndTheSameInAnyOrderOfThreads) {
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{597}, std::size_t{70001}})
    for (const std::int32_t lanes : {256, 1024}) {
      std::vector<float> x(size);
      std::vector<double> y(size), z(size);
      double xy = 0, xz = 0;
      for (std::size_t i = 0; i < size; ++i) {
        x[i] = 0.25F * static_cast<float>(i % 17) - 1;
        y[i] = 0.5 * static_cast<double>(i % 13);
        z[i] = 1 - static_cast<double>(i % 5);
        xy += static_cast<double>(x[i]) * y[i];  // exact: small multiples of 1/8
        xz += static_cast<double>(x[i]) * z[i];
      }
      for (const ThreadOrder order :
           {ThreadOrder::rising, ThreadOrder::falling, ThreadOrder::strided})
        EXPECT_EQ(sums_of(x, y, z, lanes, order), (std::vector<double>{xy, xz})) << size;
    }
}

TEST(Vectors, NothingIsReadWhereTheFactorIsZero) {
  const double nan = std::nan("");
  const double x[] = {3};
  double y[] = {nan};
  gpu::CombineBody<double, double>{{2}, {0}, x, y}(0);
  EXPECT_EQ(y[0], 6);

  double sum[1] = {};
  double u[] = {5}, r[] = {2};
  const double no[] = {nan};
  gpu::AdvanceTerms<double>{{0}, no, no, u, r}.add(0, sum);
  EXPECT_EQ(u[0], 5);
  EXPECT_EQ(r[0], 2);
  EXPECT_EQ(sum[0], 4);

  const float rough_no[] = {std::nanf("")};
  float rough_r[] = {3};
  sum[0] = 0;
  gpu::AdvanceTerms<float>{{0}, rough_no, rough_no, u, rough_r}.add(0, sum);
  EXPECT_EQ(u[0], 5);
  EXPECT_EQ(rough_r[0], 3);
  EXPECT_EQ(sum[0], 9);
}

TEST(Ceilings, AreMeasuredOnAnyDevice) {
  MirrorDevice device;
  const CudaCeilings found = gpu::measure_ceilings(device, 64, 8, 4);
  EXPECT_EQ(found.elements, 64);
  EXPECT_EQ(found.multiply_adds, 8 * 4 * 8);
  for (const double seconds : {found.triad_seconds, found.float_seconds, found.double_seconds}) {
    EXPECT_GT(seconds, 0);
    EXPECT_LT(seconds, 1);
  }
  EXPECT_EQ(device.counters().bytes_held, 0u);
}

/// A matrix that is positive definite, and its inverse found in blocks.
struct Inverted {
  std::vector<double> A, inverse;
  bool failed;
};
Inverted invert(std::int32_t n, double smallest, ThreadOrder order) {
  const auto at = [n](std::int32_t i, std::int32_t j) {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + static_cast<std::size_t>(j);
  };
  Inverted out{std::vector<double>(at(n, 0)), {}, false};
  // A chain of springs: each but the last holds on to the next.
  for (std::int32_t i = 0; i < n; ++i) {
    out.A[at(i, i)] = 2;
    if (i > 0) out.A[at(i, i - 1)] = out.A[at(i - 1, i)] = -1;
  }
  out.A[0] = 1 + smallest;
  out.A[at(n - 1, n - 1)] = 1;
  MirrorDevice device({order});
  DeviceArray<MirrorDevice, double> A(device), diagonal(device), panels(device), P(device),
      failed(device);
  A.upload(out.A);
  std::vector<double> of_diagonal;
  for (std::int32_t i = 0; i < n; ++i) of_diagonal.push_back(out.A[at(i, i)]);
  diagonal.upload(of_diagonal);
  panels.assign(2 * gpu::kBlock * static_cast<std::size_t>(n));
  P.assign(gpu::kBlock * gpu::kBlock);
  failed.upload(std::vector<double>{0});
  double* const times_P = panels.data() + at(gpu::kBlock, 0);
  for (std::int32_t first = 0; first < n; first += gpu::kBlock) {
    const std::int32_t rows = std::min(gpu::kBlock, n - first);
    device.launch(
        1, gpu::InvertBlock{n, first, rows, A.data(), diagonal.data(), P.data(), failed.data()});
    device.launch(
        n, gpu::EliminationPanels{n, first, rows, A.data(), P.data(), panels.data(), times_P});
    device.launch(n * n,
                  gpu::Eliminate{n, first, rows, A.data(), P.data(), panels.data(), times_P});
  }
  out.inverse = read(A);
  out.failed = read(failed)[0] != 0;
  return out;
}

TEST(Dense, InverseTimesMatrixIsOne) {
  constexpr double kRounding = 1e-9;  // times the condition of the chain, which grows as n^2
  for (const std::int32_t n : {1, 15, 16, 17, 53}) {
    const Inverted found = invert(n, 1, ThreadOrder::rising);
    ASSERT_FALSE(found.failed);
    const auto size = static_cast<std::size_t>(n);
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t j = 0; j < size; ++j) {
        double sum = 0;
        for (std::size_t k = 0; k < size; ++k)
          sum += found.inverse[i * size + k] * found.A[k * size + j];
        ASSERT_NEAR(sum, i == j ? 1 : 0, kRounding) << n;
      }
    EXPECT_EQ(invert(n, 1, ThreadOrder::falling).inverse, found.inverse);
    EXPECT_EQ(invert(n, 1, ThreadOrder::strided).inverse, found.inverse);
  }
}

TEST(Dense, ChainThatNothingHoldsHasNoInverse) {
  for (const std::int32_t n : {2, 16, 40}) EXPECT_TRUE(invert(n, 0, ThreadOrder::rising).failed);
}

}  // namespace
}  // namespace kerf
