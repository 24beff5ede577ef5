// SPDX-License-Identifier: MIT
#include "core/body/voxelise.hpp"

#include <cmath>

#include "core/base/error.hpp"
#include "core/base/memory.hpp"

namespace kerf {
namespace {

// What a lattice costs while a body is voxelised: three bytes a cell (inside, label, inside of a
// region) and the octree's roots; and for each cell of the faces of its box about four links that
// a surface crosses, in the lists of crossings and in the octree's records.
constexpr double kBytesPerCell = 4;
constexpr double kBytesPerFaceCell = 4 * 160;

double gibibytes(double bytes) { return std::round(bytes / (1 << 30) * 100) / 100; }

}  // namespace

Lattice make_lattice(const Box3& bounds, int resolution, int refinement, std::size_t memory_limit) {
  expects(resolution >= 1, text("resolution must be at least 1 cell, got ", resolution));
  constexpr int kMostLevels = 20;
  expects(refinement >= 0 && refinement <= kMostLevels,
          text("refinement must lie between 0 and ", kMostLevels, ", got ", refinement));
  double longest = 0;
  for (int d = 0; d < 3; ++d) {
    expects(
        std::isfinite(bounds.lo[d]) && std::isfinite(bounds.hi[d]) && bounds.lo[d] <= bounds.hi[d],
        "the body has no finite bounding box; check its coordinates");
    longest = std::max(longest, bounds.hi[d] - bounds.lo[d]);
  }
  expects(std::isfinite(longest) && longest > 0, "the body has no extent; check its size");

  Lattice lattice;
  lattice.origin = bounds.lo;
  lattice.spacing = longest / resolution;
  expects(std::isnormal(lattice.spacing),
          "the body is too small for double precision; scale it up");
  constexpr double kRounding = 1e-9;  // of a cell: a side of n cells gets n, not n + 1
  const double block = std::ldexp(1.0, refinement);
  double cells[3];
  for (int d = 0; d < 3; ++d) {
    const double side = std::ceil((bounds.hi[d] - bounds.lo[d]) / lattice.spacing - kRounding);
    cells[d] = std::ceil(std::max(side, 1.0) / block) * block;
  }
  const double faces = 2 * (cells[0] * cells[1] + cells[1] * cells[2] + cells[2] * cells[0]);
  const double need = cells[0] * cells[1] * cells[2] * kBytesPerCell + faces * kBytesPerFaceCell;
  const double have = memory_limit > 0 ? static_cast<double>(memory_limit) : physical_memory();
  constexpr double kMostCellsAlong = 1 << 20;  // so that link keys fit 64 bits
  if (need > have || std::max({cells[0], cells[1], cells[2]}) >= kMostCellsAlong)
    throw Error(ErrorKind::unavailable,
                text("a lattice of ", cells[0], " x ", cells[1], " x ", cells[2],
                     " finest cells needs ", gibibytes(need), " GiB of memory, ", gibibytes(have),
                     " GiB are there; reduce the resolution (", resolution, ")"));
  for (int d = 0; d < 3; ++d)
    lattice.size[static_cast<unsigned>(d)] = static_cast<std::int32_t>(cells[d]);
  return lattice;
}

Voxels voxelise(const Solid& body, const Lattice& lattice,
                const std::vector<std::shared_ptr<const Solid>>& regions) {
  constexpr std::size_t kMostRegions = 254;  // labels are bytes; 0 and 1 are taken
  expects(regions.size() <= kMostRegions,
          text("at most ", kMostRegions, " regions are possible, got ", regions.size()));
  Voxels voxels;
  voxels.lattice = lattice;
  {
    SolidSamples samples = body.sample(lattice);
    voxels.label = std::move(samples.inside);
    voxels.crossings = std::move(samples.crossings);
    voxels.warnings = std::move(samples.warnings);
  }
  expects(std::find(voxels.label.begin(), voxels.label.end(), 1) != voxels.label.end(),
          "no cell centre lies inside the body; raise the resolution, or check that the mesh "
          "encloses a volume");
  for (std::size_t i = 0; i < regions.size(); ++i) {
    expects(regions[i] != nullptr, text("region ", i, " has no solid"));
    const SolidSamples region = regions[i]->sample(lattice);
    for (std::size_t c = 0; c < voxels.label.size(); ++c)
      if (voxels.label[c] != 0 && region.inside[c] != 0)
        voxels.label[c] = static_cast<std::uint8_t>(i + 2);
    for (const std::string& warning : region.warnings)
      voxels.warnings.push_back(text("region ", i, ": ", warning));
  }
  return voxels;
}

}  // namespace kerf
