// SPDX-License-Identifier: MIT
//
// What one case gave, as a line of CSV. Columns: docs/convergence.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/csv.hpp"

namespace kerf::convergence {

using bench::kNone;

struct Record {
  std::string table, label;            ///< the label is unique within its table; column `case`
  std::string body;                    ///< cube, comb-aligned, comb-rotated
  int cells = 0;                       ///< along an edge
  std::vector<std::int32_t> vertices;  ///< of each level
  std::string hierarchy;               ///< duplicated, by place
  std::string cycle;                   ///< the one in use: V, W, K
  std::string smoother;                ///< Chebyshev, Gauss-Seidel
  std::string sweeps;                  ///< symmetric; forward: a cycle that stands alone
  double omega = kNone;                ///< none with Chebyshev
  double poisson = 0;
  double courant = kNone;  ///< time step in crossings of the cube by a shear wave; none: static
  double factor = kNone;   ///< what one cycle alone leaves of the error in the end
  double cg_1e6 = kNone, cg_1e10 = kNone;  ///< none: not within the limit, or a cycle alone
  double three_cycles = kNone;             ///< error after three cycles from zero
  double seconds_per_cycle = kNone;

  int levels() const { return static_cast<int>(vertices.size()); }
};

/// @throws Error (bad_input) if the file cannot be written.
void write_csv(const std::filesystem::path& file, const std::vector<Record>& records,
               const bench::Origin& origin);
/// @throws Error (bad_input) that names the file and the line.
std::vector<Record> read_csv(const std::filesystem::path& file);

}  // namespace kerf::convergence
