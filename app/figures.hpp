// SPDX-License-Identifier: MIT
//
// What figures of the method show: the cells of each multigrid level with their duplicates, and
// the links by their state. Everything lies where the body is at rest.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "core/body/linked_octree.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf {

/// The cells of one level. Each has eight points of its own, corner x + 2y + 4z, so that a picture
/// may shrink it and show those that share its place.
struct LevelFigure {
  std::vector<Vec3d> points;         ///< eight per cell, m
  std::vector<Vec3d> displacement;   ///< as points, m; of level 0 only, else empty
  std::vector<std::int32_t> size;    ///< per cell: side in finest cells
  std::vector<std::int32_t> copies;  ///< cells of this level at this very place; 1: no duplicate
  std::vector<std::int32_t> copy;    ///< which of them, from 0
  std::vector<std::int32_t> piece;   ///< of the first finest leaf that it is made of
  std::vector<double> fill;          ///< part of its place that its leaves fill, in (0, 1]
};

/// `corners` are the deformed corners of all leaves, eight per leaf in the order of body.leaves().
LevelFigure level_figure(const LinkedOctree& body, const Hierarchy& hierarchy, std::size_t level,
                         std::span<const Vec3d> corners);

enum class LinkState : std::uint8_t { connected, cut, surface };

/// Links as segments. A link between leaves that are joined, of any size, runs from centre to
/// centre. One that is disconnected lies between finest cells, or leads out of the body; each end
/// that is inside has a segment from the cell's centre to where the link is cut on its side.
struct LinksFigure {
  std::vector<std::array<Vec3d, 2>> segments;  ///< m
  std::vector<LinkState> state;
  std::vector<std::int32_t> cut_id;  ///< 0 unless a blade cut the link
};

/// Connected links in the order of leaf_links(), then ends of disconnected ones by their key.
LinksFigure links_figure(const LinkedOctree& body);

/// level_K_NNNN.vtu. @throws Error (bad_input) if the file cannot be written.
void write_level(const std::filesystem::path& file, const LevelFigure& figure);

/// links_NNNN.vtp. @throws Error (bad_input) if the file cannot be written.
void write_links(const std::filesystem::path& file, const LinksFigure& figure);

}  // namespace kerf
