// SPDX-License-Identifier: MIT
//
// What brings points into the lanes of packs and back, against loops over single lanes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "cpu/element_cells.hpp"
#include "cpu/finest_values.hpp"
#include "cpu/inverse_diagonals.hpp"
#include "cpu/patch_sweep.hpp"
#include "cpu/patched_level.hpp"
#include "cpu/stored_matrices.hpp"
#include "kernels/noise.hpp"

namespace kerf {
namespace {

using cpu::Pack;
using kernels::Vec3;

/// Records with other values in every component, the fourth zero.
template <class S>
struct Records {
  alignas(64) S s[4 * 64] = {};

  explicit Records(int first) {
    for (int n = 0; n < 64; ++n)
      for (int c = 0; c < 3; ++c) s[4 * n + c] = static_cast<S>(first + 10 * n + c);
  }
  S at(int point, int c) const { return s[4 * point + c]; }
};

template <class S>
Vec3<Pack<S>> numbers(int first) {
  Vec3<Pack<S>> out;
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    for (int c = 0; c < 3; ++c) out[c].set(k, static_cast<S>(first + 7 * k + 100 * c));
  return out;
}

template <class S>
class PointsOfPacks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(PointsOfPacks, Scalars);

TYPED_TEST(PointsOfPacks, AreGatheredFromAnywhere) {
  using S = TypeParam;
  const Records<S> x(3);
  std::array<std::uint16_t, Pack<S>::kLanes> at;
  for (std::size_t k = 0; k < at.size(); ++k) at[k] = static_cast<std::uint16_t>((37 * k + 5) % 64);

  const Vec3<Pack<S>> anywhere = cpu::gathered(x.s, at.data()), in_order = cpu::gathered(x.s + 8);

  for (int k = 0; k < Pack<S>::kLanes; ++k)
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(anywhere[c][k], x.at(at[k], c));
      EXPECT_EQ(in_order[c][k], x.at(2 + k, c));
    }
}

TYPED_TEST(PointsOfPacks, ComeBackAsRecordsInTheOrderOfTheLanes) {
  using S = TypeParam;
  const Vec3<Pack<S>> v = numbers<S>(1);
  int next = 0;

  cpu::for_records(v, [&](int lane, const typename cpu::Record<S>::Vector& record) {
    EXPECT_EQ(lane, next++);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(record[c], v[c][lane]);
    EXPECT_EQ(record[3], S(0));
  });

  EXPECT_EQ(next, Pack<S>::kLanes);
}

TYPED_TEST(PointsOfPacks, ThatSeveralLanesMeetGetTheSumOfAll) {
  using S = TypeParam;
  Records<S> y(0);
  const Records<S> before(0);
  const Vec3<Pack<S>> v = numbers<S>(1);
  std::array<std::uint16_t, Pack<S>::kLanes> at;
  for (std::size_t k = 0; k < at.size(); ++k) at[k] = static_cast<std::uint16_t>(9 + k % 3);

  cpu::add_to_points(y.s, at.data(), v);

  for (int p = 0; p < 64; ++p)
    for (int c = 0; c < 3; ++c) {
      S expected = before.at(p, c);
      for (int k = 0; k < Pack<S>::kLanes; ++k)
        if (at[k] == p) expected += v[c][k];
      EXPECT_EQ(y.at(p, c), expected);
    }
}

TEST(RecordsOfPacks, AreThoseOfTheLanesInTheirOrder) {
  constexpr int kLanes = Pack<double>::kLanes;
  const Records<double> x(3);
  const auto point = [](int lane) { return (7 * lane + 3) % 61; };
  Pack<double> records[4];
  for (int k = 0; k < 4; ++k)
    records[k] = cpu::records_of([&](int lane) { return x.s + 4 * point(lane); }, k);

  Vec3<Pack<double>> v;
  cpu::by_components(records, v);

  for (int lane = 0; lane < kLanes; ++lane)
    for (int c = 0; c < 3; ++c) {
      const int at = 4 * lane + c;
      EXPECT_EQ(records[at / kLanes][at % kLanes], x.at(point(lane), c));
      EXPECT_EQ(v[c][lane], x.at(point(lane), c));
    }
}

/// Cells whose left ends along x are at some points and whose right ends are at those behind these:
/// gather(x, left, right) and add(y, f, g) are to read and to add to them.
template <class S, class Gather, class Add>
void expect_ends(const std::array<std::uint16_t, Pack<S>::kLanes>& at, const Gather& gather,
                 const Add& add) {
  const Records<S> x(3), before(1);
  Records<S> y(1);
  Vec3<Pack<S>> left, right;
  const Vec3<Pack<S>> f = numbers<S>(1), g = numbers<S>(5);

  gather(x.s, left, right);
  add(y.s, f, g);

  std::array<std::array<S, 3>, 64> sum{};
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(left[c][k], x.at(at[k], c));
      EXPECT_EQ(right[c][k], x.at(at[k] + 1, c));
      sum[at[k]][c] += f[c][k];
      sum[at[k] + 1][c] += g[c][k];
    }
  for (int p = 0; p < 64; ++p) {
    for (int c = 0; c < 3; ++c)  // small integers: exact in any order
      EXPECT_EQ(y.at(p, c), before.at(p, c) + sum[p][c]) << "point " << p;
    EXPECT_EQ(y.at(p, 3), S(0)) << "point " << p;
  }
}

/// Rows of kRun cells that begin at several points.
template <int kRun, class S>
void expect_runs(const std::vector<std::uint16_t>& begins) {
  constexpr int kLanes = Pack<S>::kLanes;
  std::array<std::uint16_t, kLanes> at;
  std::array<std::uint16_t, kLanes / 4> heads;
  for (int k = 0; k < kLanes; ++k) at[k] = static_cast<std::uint16_t>(begins[k / kRun] + k % kRun);
  for (int k = 0; k < kLanes; k += 4) heads[k / 4] = at[k];
  expect_ends<S>(
      at, [&](const S* x, auto& l, auto& r) { cpu::gather_runs<kRun>(x, heads.data(), l, r); },
      [&](S* y, const auto& l, const auto& r) { cpu::add_runs<kRun>(y, heads.data(), l, r); });
}

TYPED_TEST(PointsOfPacks, OfRowsAreReadAndAddedToTogether) {
  using S = TypeParam;
  constexpr int kLanes = Pack<S>::kLanes;
  const std::vector<std::vector<std::uint16_t>> places = {
      {7, 30, 18, 55}, {0, 5, 10, 15}, {4, 4, 4, 4}, {16, 12, 8, 4}};
  for (const auto& begins : places) {
    expect_runs<4, S>(begins);
    if constexpr (kLanes >= 8) expect_runs<8, S>(begins);
    if constexpr (kLanes >= 16) expect_runs<16, S>(begins);
  }
}

// Of lanes that meet in a point, and of one that has none.
TYPED_TEST(PointsOfPacks, AreReadAndAddedToAsPairs) {
  using S = TypeParam;
  constexpr int kLanes = Pack<S>::kLanes;
  std::array<std::uint16_t, kLanes> at;
  for (int k = 0; k < kLanes; ++k) at[k] = static_cast<std::uint16_t>(2 + (23 * k + 5) % 17);
  at[1] = cpu::kNothing;
  at[kLanes - 1] = static_cast<std::uint16_t>(at[0] + 1);
  expect_ends<S>(
      at, [&](const S* x, auto& l, auto& r) { cpu::gather_pairs(x, at.data(), l, r); },
      [&](S* y, const auto& l, const auto& r) { cpu::add_pairs(y, at.data(), l, r); });
}

/// Cells with other rotations, by their numbers: [group][component][kGroup].
template <class S>
struct NumberedCells {
  std::vector<S> all = std::vector<S>(4 * cpu::kGroup * 4);
  bool unrotated = false;

  NumberedCells() { std::iota(all.begin(), all.end(), S(1)); }
  const S* rotation(std::size_t lane) const {
    return all.data() + 4 * cpu::kGroup * (lane / cpu::kGroup) + lane % cpu::kGroup;
  }
  template <class T>
  T component(std::size_t lane, std::size_t c) const {
    return rotation(lane)[cpu::kGroup * c];
  }
};

// Children of cells in a row are every other lane of two groups; others are anywhere, or absent.
TYPED_TEST(PointsOfPacks, RotationsOfCellsAreThoseOfTheirLanes) {
  using S = TypeParam;
  const NumberedCells<S> cells;
  const auto expect_lanes = [&](const auto& lane_of) {
    std::array<std::int32_t, Pack<S>::kLanes> lanes;
    for (int k = 0; k < Pack<S>::kLanes; ++k) lanes[k] = lane_of(k);
    kernels::Quat<Pack<S>> q;
    cpu::load_rotations(cells, lanes.data(), q);
    for (int k = 0; k < Pack<S>::kLanes; ++k) {  // of an absent cell, one of any other
      const S* const from = cells.rotation(std::size_t(std::max(lanes[k], 0)));
      const Pack<S>* const found[] = {&q.w, &q.x, &q.y, &q.z};
      for (int c = 0; c < 4; ++c)
        EXPECT_EQ((*found[c])[k], from[cpu::kGroup * c])
            << "lane " << lanes[k] << ", component " << c;
    }
  };
  for (const int first : {0, 1, 2, 15, 16, 17, 32, 33})
    expect_lanes([&](int k) { return first + 2 * k; });
  expect_lanes([](int k) { return 7 * k % 64; });
  expect_lanes([](int k) { return k == 0 ? -1 : 2 * k; });
  expect_lanes([](int k) { return k % 3 == 2 ? -1 : 2 * k; });
  expect_lanes([](int k) { return k == Pack<S>::kLanes - 1 ? 3 : 2 * k; });
  expect_lanes([](int) { return -1; });
}

TYPED_TEST(PointsOfPacks, RotationsOfCellsAreNoneWhereNoneIsAskedFor) {
  using S = TypeParam;
  NumberedCells<S> cells;
  cells.unrotated = true;
  std::array<std::int32_t, Pack<S>::kLanes> lanes;
  std::iota(lanes.begin(), lanes.end(), 3);
  kernels::Quat<Pack<S>> q;
  cpu::load_rotations(cells, lanes.data(), q);
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    EXPECT_EQ((kernels::Quat<S>{q.w[k], q.x[k], q.y[k], q.z[k]}), (kernels::Quat<S>{1, 0, 0, 0}));
}

// As two numbers of single precision they have 48 bits, and parting the sum again changes nothing.
TYPED_TEST(PointsOfPacks, RotationsAreStoredAsLanesOrAsPacks) {
  using S = TypeParam;
  cpu::FinestRotations<S> lanes, packs;
  for (auto* rotations : {&lanes, &packs}) rotations->start(1);
  std::array<std::array<double, 4>, cpu::kGroup> in;
  for (std::size_t lane = 0; lane < cpu::kGroup; ++lane)
    for (std::size_t c = 0; c < 4; ++c)
      in[lane][c] = std::ldexp(std::sin(1.0 + 4.0 * static_cast<double>(lane) + double(c)),
                               -static_cast<int>(2 * lane));
  in[3] = {1, 0, 0, 0};
  in[4][0] = 1 + 0x1p-24 - 0x1p-52;  // nearly in the middle between two
  in[5][0] = 1 + 0x1p-24;

  for (std::size_t lane = 0; lane < cpu::kGroup; ++lane) lanes.put(lane, in[lane]);
  for (int first = 0; first < cpu::kGroup; first += Pack<double>::kLanes) {
    kernels::Quat<Pack<double>> q;
    Pack<double>* const of[] = {&q.w, &q.x, &q.y, &q.z};
    for (int k = 0; k < Pack<double>::kLanes; ++k)
      for (std::size_t c = 0; c < 4; ++c) of[c]->set(k, in[std::size_t(first + k)][c]);
    packs.store(0, first, q);
    const auto back = packs.template load<double>(0, first);
    const Pack<double>* const read[] = {&back.w, &back.x, &back.y, &back.z};
    for (int k = 0; k < Pack<double>::kLanes; ++k)
      for (std::size_t c = 0; c < 4; ++c)
        EXPECT_EQ((*read[c])[k], lanes.at(std::size_t(first + k))[c]);
  }

  for (std::size_t lane = 0; lane < cpu::kGroup; ++lane) {
    const auto out = lanes.at(lane);
    EXPECT_EQ(packs.at(lane), out);
    for (std::size_t c = 0; c < 4; ++c) {
      const S rounded = *(lanes.of(lane) + cpu::kGroup * c);
      EXPECT_LE(std::abs(out[c] - in[lane][c]), 0x1p-48 * std::abs(in[lane][c]));
      EXPECT_LE(std::abs(double(rounded) - in[lane][c]), 0x1p-24 * std::abs(in[lane][c]));
      EXPECT_EQ(lanes.template component<S>(lane, c), rounded);
    }
    const S before = *lanes.of(lane);
    lanes.put(lane, out);
    EXPECT_EQ(lanes.at(lane), out);
    EXPECT_EQ(*lanes.of(lane), before);
  }
}

TEST(Codes, ComeBackAsTheNearestIntegers) {
  constexpr int kLanes = Pack<float>::kLanes;
  Pack<float> x;
  for (int k = 0; k < kLanes; ++k) x.set(k, 1000.0F * static_cast<float>(k - 4) + 0.4F);
  x.set(0, 32767);
  x.set(1, -32767);
  x.set(2, 2.5F);  // to the even one
  std::array<std::int16_t, kLanes> codes;

  cpu::store_narrowed(codes.data(), x);
  const Pack<float> back = cpu::widened(codes.data());

  EXPECT_EQ(back[0], 32767);
  EXPECT_EQ(back[1], -32767);
  EXPECT_EQ(back[2], 2);
  for (int k = 3; k < kLanes; ++k) EXPECT_EQ(back[k], 1000.0F * static_cast<float>(k - 4));
}

TEST(Codes, UpperHalvesComeBackAndAreNotBelow) {
  constexpr int kLanes = Pack<float>::kLanes;
  Pack<float> x;
  for (int k = 0; k < kLanes; ++k) x.set(k, std::ldexp(1.0F + 0.0037F * float(k), 11 * k - 60));
  x.set(0, std::numeric_limits<float>::min());
  x.set(1, 0x1p100F);
  std::array<std::int16_t, kLanes> halves;

  const Pack<float> up = cpu::rounded_up(x);
  cpu::store_upper(halves.data(), up);
  const Pack<float> back = cpu::load_upper(halves.data());

  EXPECT_EQ(back[0], x[0]);
  EXPECT_EQ(back[1], x[1]);
  for (int k = 0; k < kLanes; ++k) {
    EXPECT_EQ(back[k], up[k]) << k;
    EXPECT_GE(back[k], x[k]) << k;
    EXPECT_LE(back[k], (1 + 0x1p-7F) * x[k]) << k;
  }
}

/// Symmetric matrices of the lanes of a tile: entries in the order of kernels::Sym3.
using TileBlocks = std::array<std::array<double, 6>, cpu::kGroup>;

/// Two of four tiles as twins.
template <class S>
cpu::InverseDiagonals<S> inverse_diagonals_of(const std::vector<TileBlocks>& tiles) {
  cpu::InverseDiagonals<S> out;
  out.assign(tiles.size(), false);
  for (int first = 0; first < cpu::kGroup; first += Pack<S>::kLanes) {
    const auto blocks = [&](std::size_t t) {
      Pack<S> e[6];
      for (int i = 0; i < 6; ++i)
        for (int k = 0; k < Pack<S>::kLanes; ++k)
          e[i].set(k, static_cast<S>(tiles[t][first + k][i]));
      return kernels::Sym3<Pack<S>>{e[0], e[1], e[2], e[3], e[4], e[5]};
    };
    for (std::size_t t = 0; t < tiles.size(); ++t) {
      if (t % 4 == 1 && t + 1 < tiles.size()) {
        out.store(t, first, cpu::twins(blocks(t), blocks(t + 1)));
        ++t;
      } else {
        out.store(t, first, blocks(t));
      }
    }
  }
  return out;
}

/// Q diag(1, 1 / sqrt(condition), 1 / condition) Q^T in some frame, times `size`.
std::array<double, 6> block_of(std::uint64_t n, double condition, double size) {
  std::array<double, 4> q;
  double norm = 0;
  for (std::size_t c = 0; c < 4; ++c) q[c] = kernels::noise(4 * n + c), norm += q[c] * q[c];
  for (double& c : q) c /= std::sqrt(norm);
  const kernels::Mat3<double> R = kernels::to_matrix(kernels::Quat<double>{q[0], q[1], q[2], q[3]});
  const double d[] = {size, size / std::sqrt(condition), size / condition};
  const auto entry = [&](int i, int j) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) sum += R[i][k] * d[k] * R[j][k];
    return sum;
  };
  return {entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)};
}

template <class S>
class InverseDiagonals : public ::testing::Test {};
TYPED_TEST_SUITE(InverseDiagonals, Scalars);

// Blocks of all sizes and conditions side by side: those of a soft cell are as good as those of a
// stiff one in the same tile. Products with each unit vector are the columns of what is stored.
TYPED_TEST(InverseDiagonals, AreWithinTheirBoundOfWhatWasStoredAndDefinite) {
  using S = TypeParam;
  constexpr bool kIsSingle = std::is_same_v<S, float>;
  const double bound = kIsSingle ? 3.2e-5 : 1e-15;
  std::vector<TileBlocks> tiles(6);
  for (std::size_t n = 0; n < cpu::kGroup * tiles.size(); ++n)
    tiles[n / cpu::kGroup][n % cpu::kGroup] =
        block_of(n, std::pow(1.5e4, double(n % 5) / 4), std::pow(10.0, 3.0 * double(n % 11) - 20));
  tiles[2][5] = {};                     // wholly held
  tiles[2][6] = {0, 0, 0, 4e-9, 0, 0};  // in two components
  tiles[3][1] = {};
  tiles[3][2] = {1e5, -20, 0, 1, 0, 1};  // a component that is nearly held
  tiles[3][3] = {1e-6, 1e-4, 0, 1, -0.3, 0.5};
  tiles[3][4] = {1e-20, 0, 0, 1e-20, 0, 1e-20};
  const cpu::InverseDiagonals<S> all = inverse_diagonals_of<S>(tiles);
  constexpr int kEntry[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  for (std::size_t n = 0; n < cpu::kGroup * tiles.size(); ++n) {
    SCOPED_TRACE(n);
    const std::size_t tile = n / cpu::kGroup;
    const int lane = int(n % cpu::kGroup), k = lane % Pack<S>::kLanes;
    const std::array<double, 6>& in = tiles[tile][lane];
    double out[3][3], greatest = 0;
    for (const double e : in) greatest = std::max(greatest, std::abs(e));
    for (int j = 0; j < 3; ++j) {
      Vec3<Pack<S>> unit{Pack<S>(0), Pack<S>(0), Pack<S>(0)};
      unit[j].set(k, 1);
      const auto column = all.times(tile, lane - k, unit);
      for (int i = 0; i < 3; ++i) out[i][j] = static_cast<double>(column[i][k]);
    }
    const double diagonal[] = {in[0], in[3], in[5]};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(out[i][j], in[kEntry[i][j]],
                    bound * std::sqrt(std::min(diagonal[i], diagonal[j]) * greatest));
        EXPECT_NEAR(out[i][j], out[j][i], (kIsSingle ? 0x1p-22 : 0) * std::abs(out[i][j]));
        if (in[kEntry[i][j]] == 0) {
          EXPECT_EQ(out[i][j], 0);
        }
      }
    if (greatest > 0 && !(tile == 2 && lane == 6)) {
      kernels::Mat3<double> m;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m[i][j] = out[i][j] / std::sqrt(diagonal[i] * diagonal[j]);
      EXPECT_GT(m[0][0], 0);
      EXPECT_GT(m[0][0] * m[1][1] - m[0][1] * m[1][0], 0);
      EXPECT_GT(kernels::determinant(m), 0);
    }
  }
}

// A step that blows up has to be seen.
TYPED_TEST(InverseDiagonals, DoNotHideWhatIsNoNumber) {
  using S = TypeParam;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    for (std::size_t e = 0; e < 6; ++e) {
      std::vector<TileBlocks> tiles(1);
      for (auto& block : tiles[0]) block = {2, 0.5, 0.25, 3, -0.5, 1};
      tiles[0][3][e] = bad;
      const Pack<S> one(1);
      const auto out = inverse_diagonals_of<S>(tiles).times(0, 0, {one, one, one});
      EXPECT_FALSE(std::isfinite(out.x[3] + out.y[3] + out.z[3])) << e;
      EXPECT_NEAR(out.x[2], 2.75, 1e-3) << e;
    }
}

TEST(Lanes, GoToOtherLanesAndLeaveTheRest) {
  constexpr int kLanes = Pack<float>::kLanes;
  Pack<float> from, rest(-1);
  for (int k = 0; k < kLanes; ++k) from.set(k, static_cast<float>(100 + k));
  cpu::LanePicks picks{};
  for (int k = 0; k < kLanes; k += 2) picks.pick(k, kLanes - 1 - k);

  const Pack<float> to = cpu::LanePicker(picks)(from, rest);

  for (int k = 0; k < kLanes; ++k)
    EXPECT_EQ(to[k], k % 2 == 0 ? static_cast<float>(100 + kLanes - 1 - k) : -1) << k;
}

TEST(Lanes, AreGatheredFromAnyNumberOfGroups) {
  constexpr int kLanes = Pack<float>::kLanes, kEntries = 3;
  std::vector<std::int16_t> entries(std::size_t{cpu::kGroup} * kEntries * kLanes);
  std::iota(entries.begin(), entries.end(), std::int16_t{1});
  const auto widen = [](const std::int16_t* x) { return cpu::widened(x); };
  for (int groups = 1; groups <= kLanes; ++groups) {
    cpu::LaneSources<std::int16_t> sources;
    EXPECT_TRUE(sources.empty());
    const auto at = [&](int k) {  // group, and lane of it
      return std::pair{std::size_t(k % groups), (7 * k + 3) % cpu::kGroup};
    };
    const int none = kLanes / 2;
    for (int k = 0; k < kLanes; ++k)
      if (const auto [group, lane] = at(k); k != none)
        sources.add(k, entries.data() + cpu::kGroup * kEntries * group, lane);
    Pack<float> out[kEntries] = {Pack<float>(7), Pack<float>(7), Pack<float>(7)};

    sources.gather(0, 2, widen, Pack<float>(2), false, out);
    sources.gather(1, 3, widen, Pack<float>(1), true, out);

    for (int e = 0; e < kEntries; ++e)
      for (int k = 0; k < kLanes; ++k) {
        const auto [group, lane] = at(k);
        const std::size_t from =
            cpu::kGroup * (kEntries * group + std::size_t(e)) + std::size_t(lane);
        const float entry = k == none ? 0 : entries[from];
        EXPECT_EQ(out[e][k], e == 0 ? 2 * entry : e == 1 ? 3 * entry : 7 + entry) << e << " " << k;
      }
  }
}

/// Groups of all sorts: with codes, held ones with all entries, cells that are one element, and
/// none.
template <class S>
cpu::StoredMatrices<S> some_matrices(bool coded, bool with_mass) {
  cpu::PatchedLevel level;
  level.kind = {cpu::kMerged,  cpu::kHeldMerged, cpu::kind_of_finest(0, false),
                cpu::kIdle,    cpu::kMerged,     cpu::kGeneral,
                cpu::kNoCells, cpu::kMerged};
  level.cell.resize(cpu::kGroup * level.kind.size());
  cpu::StoredMatrices<S> out;
  out.start(level, coded, with_mass, false);
  out.allocate();
  std::uint64_t count = 0;
  for (const std::size_t group : {0, 1, 4, 5, 7})
    for (int first = 0; first < cpu::kGroup; first += Pack<S>::kLanes) {
      Pack<S> entries[kernels::kEntries];
      for (Pack<S>& entry : entries)
        for (int k = 0; k < Pack<S>::kLanes; ++k)
          entry.set(k, static_cast<S>(kernels::noise(count++)));
      out.store(group, first, entries);
    }
  return out;
}

/// An entry as products read it; zero where it is not stored.
template <class S>
S entry_of(const cpu::StoredMatrices<S>& matrices, std::int32_t lane, int entry) {
  const auto group = static_cast<std::size_t>(lane / cpu::kGroup);
  if (lane < 0 || group == 2 || group == 3 || group == 6) return 0;
  constexpr int kLanes = Pack<S>::kLanes;
  const int within = lane % cpu::kGroup;
  S out = 0;
  matrices.read(group, within / kLanes * kLanes,
                [&](const auto& entries, const Pack<S>& unit, auto translations) {
                  if (translations() || entry < kernels::kModeEntries)
                    out = (entries[entry] * unit)[within % kLanes];
                });
  return out;
}

TYPED_TEST(PointsOfPacks, MatricesOfSingleCellsComeFromAllSortsOfGroups) {
  using S = TypeParam;
  constexpr int kLanes = Pack<S>::kLanes, kAll = 8 * cpu::kGroup;
  for (const auto& [coded, with_mass] : {std::pair{true, false}, {true, true}, {false, false}}) {
    const cpu::StoredMatrices<S> matrices = some_matrices<S>(coded, with_mass);
    const auto expect = [&](const auto& lane_of) {
      std::int32_t lanes[kLanes];
      for (int k = 0; k < kLanes; ++k) lanes[k] = lane_of(k);
      Pack<S> out[kernels::kEntries];
      std::fill(std::begin(out), std::end(out), Pack<S>(7));
      matrices.gather(lanes, out);
      for (int e = 0; e < kernels::kEntries; ++e)
        for (int k = 0; k < kLanes; ++k)
          ASSERT_EQ(out[e][k], entry_of(matrices, lanes[k], e)) << "lane " << lanes[k] << ", " << e;
    };
    expect([](int k) { return k; });                                       // with codes alone
    expect([](int k) { return cpu::kGroup + k; });                         // held alone
    expect([](int k) { return (37 * k + 5) % kAll; });                     // all sorts
    expect([](int k) { return k % 3 == 1 ? -1 : (53 * k + 11) % kAll; });  // some absent
    expect([](int k) { return 2 * cpu::kGroup + k; });                     // elements
    expect([](int) { return -1; });
  }
}

TYPED_TEST(PointsOfPacks, AndMasksHoldOnlyInEveryLane) {
  using P = Pack<TypeParam>;
  const P half(0.5);
  EXPECT_TRUE(cpu::all(P(1) > half));
  for (int k = 0; k < P::kLanes; ++k) {
    P x(1);
    x.set(k, 0);
    EXPECT_FALSE(cpu::all(x > half)) << "lane " << k;
  }
}

TEST(Packs, GiveTheGreaterSizeAndPassOverWhatIsNoNumber) {
  Pack<float> a(-3), b(2);
  a.set(0, 1);
  a.set(1, std::numeric_limits<float>::quiet_NaN());
  const Pack<float> greater = cpu::greater_size(a, b);
  for (int k = 0; k < Pack<float>::kLanes; ++k) EXPECT_EQ(greater[k], k < 2 ? 2 : 3) << k;
}

TYPED_TEST(PointsOfPacks, AreZeroWhereTheyAreHeldInAnyLane) {
  using P = Pack<TypeParam>;
  for (int k = 0; k < P::kLanes; ++k) {
    std::array<std::uint8_t, cpu::kGroup> fixed{};
    fixed[static_cast<std::size_t>(k)] = 5;  // x and z
    const Vec3<P> v = cpu::masked(Vec3<P>{P(1), P(2), P(3)}, fixed.data());
    for (int lane = 0; lane < P::kLanes; ++lane) {
      EXPECT_EQ(v.x[lane], lane == k ? 0 : 1);
      EXPECT_EQ(v.y[lane], 2);
      EXPECT_EQ(v.z[lane], lane == k ? 0 : 3);
    }
  }
}

TYPED_TEST(PointsOfPacks, SumOverAllLanes) {
  using P = Pack<TypeParam>;
  P x;
  double expected = 0;
  for (int k = 0; k < P::kLanes; ++k) x.set(k, static_cast<TypeParam>(1 << k)), expected += 1 << k;
  EXPECT_EQ(cpu::sum_lanes(x), expected);
}

}  // namespace
}  // namespace kerf
