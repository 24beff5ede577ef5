// SPDX-License-Identifier: MIT
#include "core/structure.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace kerf {
namespace {

Hierarchy start_hierarchy(const SimulationSetup& setup, const LinkedOctree& body) {
  Hierarchy out;
  out.levels.push_back(finest_level(body));
  out.spacing = body.lattice().spacing;
  out.lumped_mass = setup.time.lumped_mass;
  out.poisson = {setup.material.poisson};
  for (const Region& region : setup.regions) out.poisson.push_back(region.material.poisson);
  return out;
}

// Brings more cells into an ascending list.
void merge_into(std::vector<std::int32_t>& list, std::vector<std::int32_t> more) {
  std::sort(more.begin(), more.end());
  std::vector<std::int32_t> out;
  out.reserve(list.size() + more.size());
  std::set_union(list.begin(), list.end(), more.begin(), more.end(), std::back_inserter(out));
  out.erase(std::unique(out.begin(), out.end()), out.end());
  list = std::move(out);
}

}  // namespace

Structure::Structure(const SimulationSetup& setup, const LinkedOctree& body, bool reads_incidences)
    : setup_(&setup),
      hierarchy_(start_hierarchy(setup, body)),
      external_(body.lattice(), setup.loads, hierarchy_.levels[0]) {
  Level& level = hierarchy_.levels[0];
  hierarchy_.values.reserve(with_room(level.corner.size()));
  hierarchy_.values.resize(level.corner.size());
  for (std::int32_t c = 0; c < level.cells(); ++c) set_values(body, c);
  labels_.build(level);
  merge_into(opened_, opened_cells(body));
  hold_again(body);
  build_coarse_levels(hierarchy_, options());
  if (reads_incidences || !setup.cuts.empty()) return;
  hierarchy_.forget_neighbours();
  labels_.forget_changes();
}

void Structure::forget_transfers() {
  if (!hierarchy_.has_neighbours()) hierarchy_.forget_transfers();
}

HierarchyOptions Structure::options() const {
  return {setup_->solver.coarsest_vertices, setup_->solver.max_levels,
          setup_->solver.duplicate_cells};
}

void Structure::set_values(const LinkedOctree& body, std::int32_t cell) {
  const LinkedOctree::Node& node = body.nodes()[body.leaves()[cell]];
  const Material& material = node.material == 0
                                 ? setup_->material
                                 : setup_->regions[node.material - std::size_t{1}].material;
  const double side = hierarchy_.spacing * (1 << node.size_log2);
  hierarchy_.values.set(
      cell, {material.young * side, material.density * side * side * side, node.material});
}

// All supports and, in static mode, crumbs. Returns the vertices that are held otherwise than
// before.
std::vector<std::int32_t> Structure::hold_again(const LinkedOctree& body) {
  Level& level = hierarchy_.levels[0];
  const std::vector<std::uint8_t> before = level.fixed;
  apply_supports(body.lattice(), setup_->supports, level, 0, held_);
  if (setup_->time.mode == TimeMode::statics) {
    FrozenCrumbs now = hold_crumbs(body.lattice(), labels_.by_first_cell(), labels_.count(), level);
    if (now.pieces > crumbs_.pieces) warnings_.push_back(now.warning);
    crumbs_ = std::move(now);
  }
  std::vector<std::int32_t> changed;
  for (std::int32_t v = 0; v < level.vertices(); ++v)
    if (level.fixed[v] != before[v]) changed.push_back(v);
  return changed;
}

bool Structure::update(const LinkedOctree& body, const CutEvent& event) {
  hierarchy_.cut = hierarchy_.cut || !event.disconnected.empty();
  updater_.update_finest(body, event, hierarchy_);
  Level& level = hierarchy_.levels[0];
  const LevelChange& change = finest_change();
  hierarchy_.values.resize(level.corner.size());
  for (const std::int32_t cell : change.cells) set_values(body, cell);
  for (std::int32_t c = change.cells_before; c < level.cells(); ++c) set_values(body, c);
  labels_.update(body, event, level, change);
  std::vector<std::int32_t> ends;
  for (const LinkKey key : event.disconnected) add_ends(body, key, ends);
  merge_into(opened_, std::move(ends));
  // Static mode solves many times a step, so that a pass over all vertices costs nothing there.
  std::vector<std::int32_t> held;
  if (setup_->time.mode == TimeMode::statics)
    held = hold_again(body);
  else
    apply_supports(body.lattice(), setup_->supports, level, change.vertices_before, held_);
  if (updater_.update_coarse(hierarchy_, options(), std::move(held))) return true;
  build_coarse_levels(hierarchy_, options());
  return false;
}

std::vector<std::int32_t> Structure::reloaded() const {
  const LevelChange& change = finest_change();
  std::vector<std::int32_t> out = change.vertices;
  for (std::size_t i = 0; i < change.before.size(); ++i) {
    const std::int32_t c = change.cells[i];
    const CellBefore& was = change.before[i];
    // From a cell of the same shape the same shares go out, to vertices that are listed or were not
    // changed.
    if (was.size_log2 == finest().size_log2[c] && was.fold == finest().fold[c]) continue;
    out.insert(out.end(), finest().slots[c].begin(), finest().slots[c].end());
  }
  for (std::int32_t c = change.cells_before; c < finest().cells(); ++c)
    out.insert(out.end(), finest().slots[c].begin(), finest().slots[c].end());
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::vector<double> Structure::hold(std::vector<double> values, std::int32_t first,
                                    bool is_displacement) const {
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::size_t at = 3 * static_cast<std::size_t>(first) + k;
    if ((finest().fixed[at / 3] >> (at % 3)) & 1) values[k] = is_displacement ? held_at(at) : 0;
  }
  return values;
}

double Structure::held_at(std::size_t component) const {
  const auto found = std::lower_bound(
      held_.begin(), held_.end(), component,
      [](const HeldComponent& h, std::size_t wanted) { return h.component < wanted; });
  return found != held_.end() && found->component == component ? found->displacement : 0;
}

void Structure::hold_crumbs_at(const std::vector<double>& displacement) {
  if (!has_crumbs()) return;
  std::vector<HeldComponent> crumbs, others;
  for (const std::size_t k : crumbs_.components) crumbs.push_back({k, displacement[k]});
  const auto less = [](const HeldComponent& a, const HeldComponent& b) {
    return a.component < b.component;
  };
  std::set_difference(held_.begin(), held_.end(), crumbs.begin(), crumbs.end(),
                      std::back_inserter(others), less);
  held_.clear();
  std::merge(others.begin(), others.end(), crumbs.begin(), crumbs.end(), std::back_inserter(held_),
             less);
}

}  // namespace kerf
