// SPDX-License-Identifier: MIT
//
// Two passes as in the reference backend: cells write records, vertices sum them in their fixed
// order. Each lane does what the shared bodies of kernels/ do for a scalar, eight cells at a time,
// and what follows a sum (residual, step of Chebyshev) is done while it is in registers.
#include "cpu/fast_backend.hpp"

#include <omp.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/solve/spectrum.hpp"
#include "cpu/fast_state.hpp"

namespace kerf {
namespace cpu {

template <class S>
FastBackend<S>::FastBackend(int threads)
    : threads_(threads > 0 ? threads : omp_get_max_threads()),
      coarsest_factor_(CholeskyEngine::simplicial) {
  constexpr int kMaxThreads = 1024;
  expects(threads >= 0 && threads <= kMaxThreads,
          text("solver.threads must lie in 0 .. ", kMaxThreads, "; 0 takes all cores"));
}

template <class S>
std::size_t FastBackend<S>::bytes() const {
  std::size_t sum = bytes_of(records_) + bytes_of(faces_);
  const auto add_values = [&](const auto& values) {
    sum += bytes_of(values.rotation) + bytes_of(values.stiffness) + bytes_of(values.mass) +
           bytes_of(values.side) + bytes_of(values.materials);
  };
  add_values(exact_);
  add_values(single_);
  for (const FastLevel<S>& level : levels_) {
    sum += level.packed.bytes() + bytes_of(level.matrices) + bytes_of(level.inverse_diagonal);
    for (const FastVector& vector : level.vectors)
      sum += bytes_of(vector.single) + bytes_of(vector.exact);
  }
  if (coarsest_) sum += coarsest_->value.capacity() * 12 + coarsest_factor_.factor_entries() * 12;
  return sum;
}

// Three scalars a vertex, three of the vertex that padding lanes read, and one that loads of four
// reach beyond.
template <class S>
void FastBackend<S>::allocate(FastVector& vector, std::int32_t vertices, bool exact) const {
  const std::size_t size = 3 * static_cast<std::size_t>(vertices) + 4;
  vector.single.clear();
  vector.exact.clear();
  if (exact || std::is_same_v<S, double>)
    vector.exact.assign(size, 0.0);
  else
    vector.single.assign(size, 0.0F);
}

template <class T>
PackedMaterial<T> pack_material(double poisson, bool lumped) {
  using P = Pack<T>;
  PackedMaterial<T> out;
  const auto modes = kernels::mode_constants(
      poisson, lumped ? kernels::MassModel::lumped : kernels::MassModel::consistent);
  const auto& k = modes.stiffness;
  out.modes.stiffness = {P(k.a), P(k.b), P(k.c), P(k.d), P(k.e), P(k.f), P(k.g)};
  for (int i = 0; i < 4; ++i) out.modes.mass[i] = P(modes.mass[i]);
  const auto K = kernels::unit_hex_stiffness(poisson);
  const auto M =
      lumped ? kernels::unit_hex_mass_lumped<double>() : kernels::unit_hex_mass<double>();
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) out.stiffness.k[i][j] = P(K.k[i][j]);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) out.mass.m[i][j] = P(M.m[i][j]);
  return out;
}

template <class S>
void FastBackend<S>::fill_values(const Hierarchy& hierarchy) {
  const PackedLevel& packed = levels_[0].packed;
  const auto fill = [&](auto& values) {
    using T = std::decay_t<decltype(values.stiffness[0])>;
    const std::size_t lanes = packed.cell.size();
    values.stiffness.assign(lanes, 0);
    values.mass.assign(lanes, 0);
    values.side.assign(lanes, 1);
    values.rotation.assign(4 * lanes, 0);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      values.rotation[4 * kGroup * (lane / kGroup) + lane % kGroup] = 1;
      const std::int32_t c = packed.cell[lane];
      if (c < 0) continue;
      values.stiffness[lane] = static_cast<T>(hierarchy.values[c].stiffness);
      values.mass[lane] = static_cast<T>(hierarchy.values[c].mass);
      values.side[lane] = static_cast<T>(hierarchy.spacing * (1 << packed.level->size_log2[c]));
    }
    values.materials.clear();
    for (const double poisson : hierarchy.poisson)
      values.materials.push_back(pack_material<T>(poisson, hierarchy.lumped_mass));
  };
  fill(exact_);
  if constexpr (!std::is_same_v<S, double>) fill(single_);
}

template <class S>
void FastBackend<S>::load(const Hierarchy& hierarchy) {
  hierarchy_ = &hierarchy;
  levels_.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    level.packed = pack_level(hierarchy, l, l == 0 ? nullptr : &levels_[l - 1].packed);
    level.columns.clear();
    for (const Weights& w : l == 0 ? level.packed.from_corners : level.packed.from_slots)
      level.columns.push_back(columns_of<Pack<S>>(w));
    level.bound = 0;
    level.solution_is_zero = false;
    level.vectors.resize(l == 0 ? vectors_on_finest_ : kLevelVectors);
    for (std::size_t x = 0; x < level.vectors.size(); ++x)
      allocate(level.vectors[x], level.vertices(), x >= kLevelVectors);
    level.inverse_diagonal.assign(6 * level.packed.vertices(), 0);
    level.matrices.assign(l == 0 ? 0 : kEntries * level.packed.cell.size(), 0);
  }
  fill_values(hierarchy);
  coarsest_ = std::make_unique<AssembledLevel>(hierarchy.levels.back());
  coarsest_factor_.analyse(*coarsest_);
}

template <class S>
int FastBackend<S>::add_vector() {
  if (!levels_.empty()) {
    levels_[0].vectors.emplace_back();
    allocate(levels_[0].vectors.back(), levels_[0].vertices(), true);
  }
  return vectors_on_finest_++;
}

template <class S>
void FastBackend<S>::set_operator(const OperatorScale& scale) {
  if (scale.stiffness != scale_.stiffness || scale.mass != scale_.mass)
    for (FastLevel<S>& level : levels_) level.bound = 0;
  scale_ = scale;
}

template <class S>
void FastBackend<S>::round_rotations() {
  if constexpr (!std::is_same_v<S, double>)
    for (std::size_t i = 0; i < exact_.rotation.size(); ++i)
      single_.rotation[i] = static_cast<S>(exact_.rotation[i]);
}

template <class S>
void FastBackend<S>::rotate_cells(int displacement) {
  const double* u = levels_[0].vectors[displacement].exact.data();
  parallel(levels_[0].groups(), kWorthGroups, [&](std::int32_t g) {
    rotate_group(levels_[0].packed, exact_, static_cast<std::size_t>(g), u);
  });
  round_rotations();
}

template <class S>
void FastBackend<S>::read_rotations(std::span<double> out) const {
  const PackedLevel& packed = levels_[0].packed;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const auto lane = static_cast<std::size_t>(packed.lane[c]);
    for (std::size_t k = 0; k < 4; ++k)
      out[4 * c + k] = exact_.rotation[4 * kGroup * (lane / kGroup) + kGroup * k + lane % kGroup];
  }
}

template <class S>
void FastBackend<S>::write_rotations(std::span<const double> in) {
  const PackedLevel& packed = levels_[0].packed;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const auto lane = static_cast<std::size_t>(packed.lane[c]);
    for (std::size_t k = 0; k < 4; ++k)
      exact_.rotation[4 * kGroup * (lane / kGroup) + kGroup * k + lane % kGroup] = in[4 * c + k];
  }
  round_rotations();
}

template <class S>
template <class T>
void FastBackend<S>::apply_typed(int level, const OperatorScale& scale, bool masks, int in,
                                 int out) {
  FastLevel<S>& l = levels_[level];
  const T* all = products<T>(level, scale, l.vectors[in].template in<T>().data());
  T* to = l.vectors[out].template in<T>().data();
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    store(to, v, masked(sum_records(l.packed, all, v), masks ? l.fixed(v) : std::uint8_t{0}));
  });
}

template <class S>
void FastBackend<S>::apply(int level, int in, int out) {
  ensures(is_exact(level, in) == is_exact(level, out), "apply mixes vectors of two precisions");
  changed(level, out);
  if (is_exact(level, in))
    apply_typed<double>(level, scale_, true, in, out);
  else
    apply_typed<S>(level, scale_, true, in, out);
}

template <class S>
void FastBackend<S>::apply_scaled(const OperatorScale& scale, int in, int out) {
  expects_exact(in, out);
  apply_typed<double>(0, scale, false, in, out);
}

template <class S>
void FastBackend<S>::elastic_force(int displacement, int out) {
  expects_exact(displacement, out);
  FastLevel<S>& l = levels_[0];
  const double* u = l.vectors[displacement].exact.data();
  double* all = records<double>(0);
  parallel(l.groups(), kWorthGroups, [&](std::int32_t g) {
    elastic_records(l.packed, exact_, static_cast<std::size_t>(g), u, all);
  });
  double* to = l.vectors[out].exact.data();
  parallel(l.vertices(), kWorthVertices,
           [&](std::int32_t v) { store(to, v, sum_records<double>(l.packed, all, v)); });
}

// The n-th children of the coarse cells in the lanes: their matrices and their weights.
template <class S>
void FastBackend<S>::add_children(const FastLevel<S>& from, bool finest,
                                  const std::int32_t (&child)[Pack<S>::kLanes],
                                  Pack<S> (&sum)[kEntries]) const {
  using P = Pack<S>;
  const PackedLevel& packed = from.packed;
  P full[24][24];
  bool over_slots = true;
  if (finest) {
    const FinestLanes<S> lanes(packed, values_of<S>(), scale_, child);
    corner_matrices(packed, values_of<S>(), lanes, full);
    // Held components are those of slots, so there the way from corners has two steps.
    over_slots = lanes.any_fixed;
    if (lanes.any_fixed && lanes.any_folded) fold_matrices(packed, lanes, full);
    if (lanes.any_fixed) mask_matrices(packed, lanes, full);
  } else {
    stored_matrices(packed, from.matrices.data(), child, full);
  }
  const std::vector<Weights>& table = over_slots ? packed.from_slots : packed.from_corners;
  const Weights* w[P::kLanes];
  std::int32_t first = -1;
  bool alike = over_slots != finest;  // the columns that are at hand
  for (int k = 0; k < P::kLanes; ++k) {
    w[k] = nullptr;
    if (child[k] < 0) continue;  // its matrix is zero
    const std::int32_t index = packed.weights[child[k]];
    w[k] = &table[static_cast<std::size_t>(index)];
    alike = alike && (first < 0 || index == first);
    first = index;
  }
  if (alike)
    add_product(full, from.columns[static_cast<std::size_t>(first)], sum);
  else
    add_product(full, columns_of<P>(w), sum);
}

template <class S>
void FastBackend<S>::coarsen(int fine) {
  using P = Pack<S>;
  const FastLevel<S>& from = levels_[fine];
  FastLevel<S>& to = levels_[fine + 1];
  const Level& coarse = *to.packed.level;
  parallel(to.groups(), kWorthMatrices, [&](std::int32_t g) {
    for_packs<S>([&](int first) {
      const std::int32_t* cells = to.packed.cell.data() + kGroup * g + first;
      P sum[kEntries] = {};
      for (std::int32_t n = 0;; ++n) {
        std::int32_t child[P::kLanes];
        bool any = false;
        for (int k = 0; k < P::kLanes; ++k) {
          child[k] = -1;
          if (cells[k] < 0) continue;
          const std::int32_t at = coarse.child_begin[cells[k]] + n;
          if (at >= coarse.child_begin[cells[k] + 1]) continue;
          child[k] = coarse.children[at];
          any = true;
        }
        if (!any) break;
        add_children(from, fine == 0, child, sum);
      }
      S* tile = to.matrices.data() + kEntries * kGroup * static_cast<std::size_t>(g) + first;
      for (int e = 0; e < kEntries; ++e) store_pack(tile + kGroup * e, sum[e]);
    });
  });
}

template <class S>
void FastBackend<S>::prepare(int level) {
  FastLevel<S>& l = levels_[level];
  const std::size_t scalars = 8 * 8 * l.packed.cell.size();  // six of eight a record
  records_.resize(std::max(records_.size(), scalars * sizeof(S) / sizeof(double) + 1));
  S* const blocks = reinterpret_cast<S*>(records_.data());
  parallel(l.groups(), kWorthGroups, [&](std::int32_t g) {
    const auto group = static_cast<std::size_t>(g);
    if (level == 0)
      finest_diagonals(l.packed, values_of<S>(), scale_, group, blocks);
    else
      stored_diagonals(l.matrices.data(), group, blocks);
  });
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    kernels::Sym3<S> sum{};
    for (std::int32_t k = l.packed.level->incidence_begin[v];
         k < l.packed.level->incidence_begin[v + 1]; ++k) {
      const S* b = blocks + 8 * static_cast<std::size_t>(l.packed.record[k]);
      sum += kernels::Sym3<S>{b[0], b[1], b[2], b[4], b[5], b[6]};
    }
    const std::uint8_t fixed = l.fixed(v);
    if (fixed & 1) sum.xx = sum.xy = sum.xz = 0;
    if (fixed & 2) sum.yy = sum.xy = sum.yz = 0;
    if (fixed & 4) sum.zz = sum.xz = sum.yz = 0;
    const auto inverse = kernels::inverse_semidefinite(sum);
    S* to = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
    to[0] = inverse.xx, to[1] = inverse.xy, to[2] = inverse.xz;
    to[3] = inverse.yy, to[4] = inverse.yz, to[5] = inverse.zz;
  });
  if (l.bound == 0 && level + 1 < static_cast<int>(levels_.size()))
    l.bound = estimate_spectral_bound(*this, level, *l.packed.level);
}

template <class S>
void FastBackend<S>::read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const {
  const FastLevel<S>& l = levels_[level];
  std::int32_t cells[Pack<double>::kLanes];
  std::fill(std::begin(cells), std::end(cells), -1);
  cells[0] = cell;
  if (level == 0) {
    Pack<double> full[24][24];
    const FinestLanes<double> lanes(l.packed, exact_, scale_, cells);
    corner_matrices(l.packed, exact_, lanes, full);
    if (lanes.any_folded) fold_matrices(l.packed, lanes, full);
    if (lanes.any_fixed) mask_matrices(l.packed, lanes, full);
    for (int i = 0; i < 24; ++i)
      for (int j = 0; j <= i; ++j)
        out[static_cast<std::size_t>(kernels::packed_index(i, j))] = full[i][j][0];
    return;
  }
  const auto lane = static_cast<std::size_t>(l.packed.lane[cell]);
  for (std::size_t e = 0; e < kEntries; ++e)
    out[e] = l.matrices[kEntries * kGroup * (lane / kGroup) + kGroup * e + lane % kGroup];
}

template <class S>
void FastBackend<S>::factor_coarsest() {
  const int last = static_cast<int>(levels_.size()) - 1;
  coarsest_->assemble(hierarchy_->levels.back(), [&](std::int32_t cell, std::span<double> out) {
    read_cell_matrix(last, cell, out);
  });
  if (last > 0) coarsest_->strengthen_diagonal();
  expects(
      coarsest_factor_.factor(*coarsest_),
      "the system matrix is not positive definite: in static mode some part of the body can move "
      "freely and needs a [[support]]; otherwise sizes, moduli or the time step are out of range");
}

template class FastBackend<float>;
template class FastBackend<double>;

}  // namespace cpu

std::unique_ptr<Backend> make_fast_backend(const FastOptions& options) {
  if (options.single_cycle) return std::make_unique<cpu::FastBackend<float>>(options.threads);
  return std::make_unique<cpu::FastBackend<double>>(options.threads);
}

}  // namespace kerf
