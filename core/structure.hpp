// SPDX-License-Identifier: MIT
//
// All that blades change beside the octree and the surface: levels, supports, pieces, loads.
// Built once; then every blade changes it in place, at the cost of what it touched.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/body/cut.hpp"
#include "core/fem/held.hpp"
#include "core/fem/loads.hpp"
#include "core/levels/piece_labels.hpp"
#include "core/levels/update.hpp"
#include "core/setup.hpp"

namespace kerf {

class Structure {
 public:
  /// `setup` must outlive this. `reads_incidences`: whether others do so; if not, and no blade is
  /// to come, much of the levels is not kept.
  Structure(const SimulationSetup& setup, const LinkedOctree& body, bool reads_incidences = true);

  /// After a blade pass that changed something. Returns whether the coarse levels changed in place;
  /// else they were built anew. Level 0 always changes in place.
  /// @throws Error (bad_input) in static mode if a piece is held by nothing.
  bool update(const LinkedOctree& body, const CutEvent& event);
  /// Of the last update.
  const HierarchyChange& change() const { return updater_.change(); }
  const LevelChange& finest_change() const { return updater_.change().levels[0]; }

  const Hierarchy& hierarchy() const { return hierarchy_; }
  const Level& finest() const { return hierarchy_.levels[0]; }
  void pack() { hierarchy_.pack(); }
  /// After a load: gives back what is not read again where no blade is to come.
  void forget_transfers();
  std::size_t pieces() const { return labels_.count(); }
  /// The cells of those of a few cells; none in static mode, where they are held, and nothing adds
  /// up over time.
  std::vector<std::vector<std::int32_t>> small_pieces() const {
    if (setup_->time.mode == TimeMode::statics) return {};
    return labels_.small();
  }
  std::vector<std::int32_t> piece_of_cells() const { return labels_.by_first_cell(); }
  const ExternalForce& external() const { return external_; }
  /// Cells of level 0 with a link to another cell that was cut, ascending.
  const std::vector<std::int32_t>& opened() const { return opened_; }

  /// Vertices on which the external force may differ from before the last update.
  std::vector<std::int32_t> reloaded() const;
  /// `values`, three for each vertex of [first, first + values.size() / 3), with held components
  /// set: to the held displacement, or to zero.
  std::vector<double> hold(std::vector<double> values, std::int32_t first,
                           bool is_displacement) const;
  /// Whether some held displacement is not zero.
  bool is_prescribed() const { return !held_.empty(); }
  bool has_crumbs() const { return !crumbs_.components.empty(); }
  /// Crumbs stay where they are: at `displacement`, three for each vertex.
  void hold_crumbs_at(const std::vector<double>& displacement);
  std::size_t bytes() const {
    return hierarchy_.bytes() + labels_.bytes() + held_.size() * sizeof(held_[0]) +
           opened_.size() * sizeof(std::int32_t);
  }
  /// Warnings since the last call.
  std::vector<std::string> take_warnings() { return std::exchange(warnings_, {}); }

 private:
  void set_values(const LinkedOctree& body, std::int32_t cell);
  std::vector<std::int32_t> hold_again(const LinkedOctree& body);
  HierarchyOptions options() const;
  double held_at(std::size_t component) const;

  const SimulationSetup* setup_;
  Hierarchy hierarchy_;
  LevelUpdater updater_;
  PieceLabels labels_;
  std::vector<std::int32_t> opened_;
  std::vector<HeldComponent> held_;  // ascending; other held components are held at zero
  FrozenCrumbs crumbs_;
  std::vector<std::string> warnings_;
  ExternalForce external_;  // last: needs level 0
};

}  // namespace kerf
