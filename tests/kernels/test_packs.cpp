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
  out.start(level, coded, with_mass);
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
