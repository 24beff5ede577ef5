// SPDX-License-Identifier: MIT
//
// The bodies of kernels/ over groups of eight cells: loading and storing of lanes, no loops over
// groups and no threads.
#pragma once

#include <algorithm>
#include <vector>

#include "core/backend.hpp"
#include "cpu/packed_level.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/modes.hpp"
#include "kernels/residual.hpp"
#include "kernels/rotation.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {

using kernels::kEntries;

/// Constants of one Poisson ratio and mass model, in every lane.
template <class S>
struct PackedMaterial {
  kernels::ModeConstants<Pack<S>> modes;
  kernels::HexStiffness<Pack<S>> stiffness;
  kernels::HexMass<Pack<S>> mass;
};

/// What the elements of level 0 are made of. A lane without a cell has no stiffness and no mass.
template <class S>
struct FinestValues {
  std::vector<S> rotation;               // [group][w x y z][lane]
  std::vector<S> stiffness, mass, side;  // per lane: E side, density side^3, side
  std::vector<PackedMaterial<S>> materials;

  kernels::Quat<Pack<S>> quaternion(std::size_t group, int first_lane) const {
    const S* q = rotation.data() + 4 * kGroup * group + first_lane;
    return {load_pack(q), load_pack(q + kGroup), load_pack(q + 2 * kGroup),
            load_pack(q + 3 * kGroup)};
  }
  void set_quaternion(std::size_t group, int first_lane, const kernels::Quat<Pack<S>>& q) {
    S* to = rotation.data() + 4 * kGroup * group + first_lane;
    store_pack(to, q.w);
    store_pack(to + kGroup, q.x);
    store_pack(to + 2 * kGroup, q.y);
    store_pack(to + 3 * kGroup, q.z);
  }
};

/// The vertices at the slots of a part of a group: all of it for floats, one half for doubles.
template <class S>
void load_slots(const PackedLevel& level, std::size_t group, int first_lane, const S* u,
                kernels::Vec3<Pack<S>> (&out)[8]) {
  const std::int32_t* slots = level.slots.data() + 8 * kGroup * group + first_lane;
  for (int i = 0; i < 8; ++i) out[i] = gather(u, slots + kGroup * i);
}

template <class S>
void store_records(std::size_t group, int first_lane, const kernels::Vec3<Pack<S>> (&f)[8],
                   S* records) {
  S* to = records + 4 * (8 * kGroup * group + static_cast<std::size_t>(first_lane));
  for (int i = 0; i < 8; ++i) scatter_records(to + 4 * kGroup * i, f[i]);
}

/// Calls body(first lane) for each pack of a group.
template <class S, class Body>
void for_packs(const Body& body) {
  for (int first = 0; first < kGroup; first += Pack<S>::kLanes) body(first);
}

/// Records of A u for a group of level 0.
template <class S>
void finest_products(const PackedLevel& level, const FinestValues<S>& values,
                     const OperatorScale& scale, std::size_t group, const S* u, S* records) {
  using P = Pack<S>;
  const PackedMaterial<S>& material = values.materials[level.material[group]];
  const kernels::FoldCode fold = level.fold[group];
  for_packs<S>([&](int first) {
    const std::size_t lane = kGroup * group + static_cast<std::size_t>(first);
    const auto R = kernels::to_matrix(values.quaternion(group, first));
    const P stiffness = P(scale.stiffness) * load_pack(values.stiffness.data() + lane);
    const P mass = P(scale.mass) * load_pack(values.mass.data() + lane);
    kernels::Vec3<P> at[8];
    load_slots(level, group, first, u, at);
    if (!kernels::has_hanging(fold)) {
      kernels::apply_cell(at, R, stiffness, mass, material.modes, at);
    } else {
      kernels::Vec3<P> corners[8];
      kernels::unfold(at, fold, corners);
      kernels::apply_cell(corners, R, stiffness, mass, material.modes, corners);
      kernels::fold_transpose(corners, fold, at);
    }
    store_records(group, first, at, records);
  });
}

/// Records of A u for a group of a stored level.
template <class S>
void stored_products(const PackedLevel& level, const S* matrices, std::size_t group, const S* u,
                     S* records) {
  using P = Pack<S>;
  for_packs<S>([&](int first) {
    const S* tile = matrices + kEntries * kGroup * group + first;
    kernels::Vec3<P> at[8], f[8];
    load_slots(level, group, first, u, at);
    struct Entries {
      const S* tile;
      P operator[](int entry) const { return load_pack(tile + kGroup * entry); }
    };
    kernels::apply_packed(Entries{tile}, at, f);
    store_records(group, first, f, records);
  });
}

/// Records of the elastic force of a group of level 0.
template <class S>
void elastic_records(const PackedLevel& level, const FinestValues<S>& values, std::size_t group,
                     const S* u, S* records) {
  using P = Pack<S>;
  const kernels::FoldCode fold = level.fold[group];
  for_packs<S>([&](int first) {
    const std::size_t lane = kGroup * group + static_cast<std::size_t>(first);
    kernels::Vec3<P> at[8], corners[8];
    load_slots(level, group, first, u, at);
    kernels::unfold(at, fold, corners);
    kernels::elastic_force(corners, values.quaternion(group, first),
                           load_pack(values.side.data() + lane),
                           load_pack(values.stiffness.data() + lane),
                           values.materials[level.material[group]].modes.stiffness, corners);
    kernels::fold_transpose(corners, fold, at);
    store_records(group, first, at, records);
  });
}

/// Rotations of a group from the displacements, warm-started. Where Newton proves nothing within
/// its steps, a lane goes the way of the reference.
template <class S>
void rotate_group(const PackedLevel& level, FinestValues<S>& values, std::size_t group,
                  const S* u) {
  using P = Pack<S>;
  constexpr int kIterations = 8;
  const P small2 = P(S(0.01) * kernels::Precision<S>::kEpsilon);
  for_packs<S>([&](int first) {
    const std::size_t lane = kGroup * group + static_cast<std::size_t>(first);
    kernels::Vec3<P> at[8], corners[8];
    load_slots(level, group, first, u, at);
    kernels::unfold(at, level.fold[group], corners);
    const auto F = kernels::mean_gradient(corners, load_pack(values.side.data() + lane));
    const auto start = values.quaternion(group, first);
    auto q = kernels::normalised(start);
    PackMask<S> proven = {P(S(1)).v < P(S(0)).v}, lost = proven;
    for (int i = 0; i < kIterations; ++i) {
      const auto step = kernels::rotation_step(F, q);
      lost = lost || !(step.ascent || proven);
      q = {select(proven, q.w, step.next.w), select(proven, q.x, step.next.x),
           select(proven, q.y, step.next.y), select(proven, q.z, step.next.z)};
      proven = proven || (step.ascent && step.length2 <= small2);
      if (all(proven || lost)) break;
    }
    const PackMask<S> done = proven && !lost;
    if (!all(done))
      for (int k = 0; k < P::kLanes; ++k) {
        if (done.v[k] != 0) continue;
        kernels::Mat3<S> f;
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) f[a][b] = F[a][b][k];
        const auto turned = kernels::extract_rotation(
            f, kernels::Quat<S>{start.w[k], start.x[k], start.y[k], start.z[k]});
        q.w.set(k, turned.w);
        q.x.set(k, turned.x);
        q.y.set(k, turned.y);
        q.z.set(k, turned.z);
      }
    values.set_quaternion(group, first, q);
  });
}

/// Some cells of level 0, one in each lane: -1 is none.
template <class S>
struct FinestLanes {
  using P = Pack<S>;
  kernels::Mat3<P> R;
  P stiffness{}, mass{};  // none in a lane without a cell
  bool any_folded = false, any_fixed = false;
  int material = -1;  // of the cells; -2 where they differ
  std::int32_t cell[P::kLanes];

  FinestLanes(const PackedLevel& level, const FinestValues<S>& values, const OperatorScale& scale,
              const std::int32_t* cells) {
    kernels::Quat<P> q;
    for (int k = 0; k < P::kLanes; ++k) {
      cell[k] = cells[k];
      if (cell[k] < 0) continue;
      const auto lane = static_cast<std::size_t>(level.lane[cell[k]]);
      const std::size_t group = lane / kGroup, in = lane % kGroup;
      const S* from = values.rotation.data() + 4 * kGroup * group + in;
      q.w.set(k, from[0]);
      q.x.set(k, from[kGroup]);
      q.y.set(k, from[2 * kGroup]);
      q.z.set(k, from[3 * kGroup]);
      stiffness.set(k, static_cast<S>(scale.stiffness) * values.stiffness[lane]);
      mass.set(k, static_cast<S>(scale.mass) * values.mass[lane]);
      any_folded = any_folded || kernels::has_hanging(level.fold[group]);
      any_fixed = any_fixed || level.has_fixed[cell[k]] != 0;
      const int its = level.material[group];
      material = material == -1 || material == its ? its : -2;
    }
    R = kernels::to_matrix(q);
  }
};

/// Columns of W, the same in all lanes.
template <class P>
kernels::WeightColumns<P> columns_of(const Weights& w) {
  kernels::WeightColumns<P> out{};
  for (int m = 0; m < 8; ++m)
    for (int i = 0; i < 8; ++i) {
      if (w.w[i][m] == 0) continue;
      const int at = out.count[m]++;
      out.child[m][at] = i;
      out.weight[m][at] = P(w.w[i][m]);
    }
  return out;
}

/// Columns of the W of each lane, with their non-zeros in any lane; null is a lane without a cell.
template <class P>
kernels::WeightColumns<P> columns_of(const Weights* const (&w)[P::kLanes]) {
  using S = typename P::Scalar;
  kernels::WeightColumns<P> out{};
  for (int m = 0; m < 8; ++m)
    for (int i = 0; i < 8; ++i) {
      S weight[P::kLanes];
      bool any = false;
      for (int k = 0; k < P::kLanes; ++k) {
        weight[k] = w[k] == nullptr ? S(0) : static_cast<S>(w[k]->w[i][m]);
        any = any || weight[k] != 0;
      }
      if (!any) continue;
      const int at = out.count[m]++;
      out.child[m][at] = i;
      out.weight[m][at] = load_pack(weight);
    }
  return out;
}

/// sum += W^T A W, A given in full.
template <class P>
void add_product(const P (&full)[24][24], const kernels::WeightColumns<P>& columns,
                 P (&sum)[kEntries]) {
  P strip[3][24];
  for (int n = 0; n < 8; ++n) {
    if (columns.count[n] == 0) continue;
    kernels::gather_strip(full, columns, n, strip);
    for (int m = n; m < 8; ++m) {
      if (columns.count[m] == 0) continue;
      const kernels::Mat3<P> block = kernels::gather_block(strip, columns, m);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < (m == n ? a + 1 : 3); ++b)
          sum[kernels::packed_index(3 * m + a, 3 * n + b)] += block[a][b];
    }
  }
}

/// Matrices of some cells of level 0 over their corners, in full.
template <class S>
void corner_matrices(const PackedMaterial<S>& m, const FinestLanes<S>& lanes,
                     Pack<S> (&full)[24][24]) {
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j <= i; ++j) {
      const auto block =
          kernels::rotate_block(m.stiffness, m.mass, lanes.R, lanes.stiffness, lanes.mass, i, j);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          full[3 * i + a][3 * j + b] = full[3 * j + b][3 * i + a] =
              i == j && b > a ? block[b][a] : block[a][b];
    }
}

/// The same where lanes may be of several materials.
template <class S>
void corner_matrices(const PackedLevel& level, const FinestValues<S>& values,
                     const FinestLanes<S>& lanes, Pack<S> (&full)[24][24]) {
  if (lanes.material != -2) {
    const auto material = static_cast<std::size_t>(std::max(lanes.material, 0));
    return corner_matrices(values.materials[material], lanes, full);
  }
  for (std::size_t m = 0; m < values.materials.size(); ++m) {
    Pack<S> some[24][24];
    corner_matrices(values.materials[m], lanes, some);
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      const bool none = lanes.cell[k] < 0;
      if (!none &&
          level.material[static_cast<std::size_t>(level.lane[lanes.cell[k]]) / kGroup] != m)
        continue;
      for (int i = 0; i < 24; ++i)
        for (int j = 0; j < 24; ++j) full[i][j].set(k, some[i][j][k]);
    }
  }
}

/// Brings matrices of cells of level 0 from corners to slots.
template <class S>
void fold_matrices(const PackedLevel& level, const FinestLanes<S>& lanes, Pack<S> (&full)[24][24]) {
  using P = Pack<S>;
  Weights fold[P::kLanes];
  const Weights* w[P::kLanes];
  for (int k = 0; k < P::kLanes; ++k) {
    w[k] = nullptr;
    if (lanes.cell[k] < 0) continue;
    kernels::fold_weights(level.level->fold[lanes.cell[k]], fold[k].w);
    w[k] = &fold[k];
  }
  P sum[kEntries] = {};
  add_product(full, columns_of<P>(w), sum);
  kernels::expand_packed(static_cast<const P*>(sum), full);
}

/// Zero in the rows and columns of held components. Needs  matrices over slots.
template <class S>
void mask_matrices(const PackedLevel& level, const FinestLanes<S>& lanes, Pack<S> (&full)[24][24]) {
  Pack<S> keep[24];
  for (int i = 0; i < 24; ++i) {
    S of[Pack<S>::kLanes];
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      of[k] = 1;
      if (lanes.cell[k] < 0) continue;
      const std::int32_t v = level.level->slots[lanes.cell[k]][static_cast<std::size_t>(i / 3)];
      if ((level.level->fixed[v] >> (i % 3) & 1) != 0) of[k] = 0;
    }
    keep[i] = load_pack(of);
  }
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) full[i][j] *= keep[i] * keep[j];
}

/// Matrices of some cells of a stored level, in full; zero where there is no cell.
template <class S>
void stored_matrices(const PackedLevel& level, const S* matrices, const std::int32_t* cells,
                     Pack<S> (&full)[24][24]) {
  using P = Pack<S>;
  P packed[kEntries] = {};
  for (int k = 0; k < P::kLanes; ++k) {
    if (cells[k] < 0) continue;
    const auto lane = static_cast<std::size_t>(level.lane[cells[k]]);
    const S* tile = matrices + kEntries * kGroup * (lane / kGroup) + lane % kGroup;
    for (int e = 0; e < kEntries; ++e) packed[e].set(k, tile[kGroup * e]);
  }
  kernels::expand_packed(static_cast<const P*>(packed), full);
}

/// Writes a symmetric block a lane as two records.
template <class S>
void store_blocks(std::size_t group, int first_lane, int slot, const kernels::Sym3<Pack<S>>& b,
                  S* blocks) {
  using P = Pack<S>;
  S rows[2][4 * P::kLanes];
  scatter_records(rows[0], {b.xx, b.xy, b.xz});
  scatter_records(rows[1], {b.yy, b.yz, b.zz});
  S* to = blocks + 8 * (8 * kGroup * group + static_cast<std::size_t>(kGroup * slot + first_lane));
  for (int k = 0; k < P::kLanes; ++k)
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 4; ++c) to[8 * k + 4 * r + c] = rows[r][4 * k + c];
}

/// Diagonal blocks at the slots of a group of level 0.
template <class S>
void finest_diagonals(const PackedLevel& level, const FinestValues<S>& values,
                      const OperatorScale& scale, std::size_t group, S* blocks) {
  using P = Pack<S>;
  const PackedMaterial<S>& m = values.materials[level.material[group]];
  const kernels::FoldCode fold = level.fold[group];
  double w[8][8];
  kernels::fold_weights(fold, w);
  for_packs<S>([&](int first) {
    const std::size_t lane = kGroup * group + static_cast<std::size_t>(first);
    const auto R = kernels::to_matrix(values.quaternion(group, first));
    const P stiffness = P(scale.stiffness) * load_pack(values.stiffness.data() + lane);
    const P mass = P(scale.mass) * load_pack(values.mass.data() + lane);
    for (int slot = 0; slot < 8; ++slot) {
      kernels::Mat3<P> sum;
      for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j) {
          const double both = w[i][slot] * w[j][slot];
          if (both != 0)
            sum += kernels::rotate_block(m.stiffness, m.mass, R, P(both) * stiffness,
                                         P(both) * mass, i, j);
        }
      store_blocks(group, first, slot, kernels::lower_triangle(sum), blocks);
    }
  });
}

/// Diagonal blocks at the slots of a group of a stored level.
template <class S>
void stored_diagonals(const S* matrices, std::size_t group, S* blocks) {
  using P = Pack<S>;
  for_packs<S>([&](int first) {
    const S* tile = matrices + kEntries * kGroup * group + first;
    struct Entries {
      const S* tile;
      P operator[](int entry) const { return load_pack(tile + kGroup * entry); }
    };
    for (int slot = 0; slot < 8; ++slot)
      store_blocks(group, first, slot, kernels::packed_diagonal<P>(Entries{tile}, slot), blocks);
  });
}

}  // namespace kerf::cpu
