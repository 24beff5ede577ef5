// SPDX-License-Identifier: MIT
//
// What a run leaves behind: a folder that is either finished or untouched. docs/results.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/folder_lock.hpp"
#include "app/scene.hpp"
#include "core/simulation.hpp"

namespace kerf {

/// The content of summary.json.
struct Summary {
  std::string scene, title;
  std::size_t cells = 0, cells_before_cuts = 0, vertices = 0, unknowns = 0, hanging = 0;
  std::size_t pieces = 0, links_cut = 0;
  SurfaceMethod surface = SurfaceMethod::none;
  std::size_t surface_points = 0, surface_triangles = 0;  ///< at the end
  std::vector<std::size_t> level_cells, level_vertices;   ///< finest first
  PhaseTimes seconds;
  double seconds_total = 0;
  std::vector<StepReport> steps;
  std::size_t peak_bytes = 0;  ///< of the process
  std::size_t bytes = 0;       ///< held by body, hierarchy and backend
  std::string backend, instruction_set, precision;
  int threads = 0;
  std::uint64_t state_hash = 0;
  bool converged = true, interrupted = false;
  std::vector<std::string> warnings;
};

/// JSON text; numbers that are not finite become null.
std::string to_json(const Summary& summary);

/// Writes `snapshot` as a VTK unstructured grid: XML, raw appended data, little endian.
/// @throws Error (bad_input) if the file cannot be written.
void write_vtu(const std::filesystem::path& file, const Snapshot& snapshot);

/// Files are written under temporary names (".NAME.partial") and get their own when `commit` is
/// called, the summary last; without a commit, nothing remains. Files that an earlier run of kerf
/// left are replaced or removed then; others are not touched.
class ResultsFolder {
 public:
  /// Creates the folder if it is absent, and locks it.
  /// @throws Error (bad_input) if it is a file, cannot be written, or another run writes into it.
  ResultsFolder(std::filesystem::path folder, OutputSettings settings);
  ~ResultsFolder();
  ResultsFolder(const ResultsFolder&) = delete;
  ResultsFolder& operator=(const ResultsFolder&) = delete;

  void add_snapshot(int step, double time, const Snapshot& snapshot);
  /// The files of the surface that are asked for. Returns why one of them was left out, if so.
  std::string add_surface(int step, double time, const SurfaceMesh& surface);
  /// Levels and links, where asked for. `corners` are those of Simulation::deformed_corners().
  void add_figures(int step, const LinkedOctree& body, const Hierarchy& hierarchy,
                   std::span<const Vec3d> corners);
  /// A temporary path for one more file; it must exist when `commit` is called.
  std::filesystem::path add_file(const std::string& name);
  void drop_file(const std::string& name);  ///< takes it back, written or not
  void commit(const Summary& summary);

  const std::filesystem::path& folder() const { return folder_; }

 private:
  /// Times and the files that show them.
  using Series = std::vector<std::pair<double, std::string>>;

  void expect_in_place() const;
  void write_text(const std::string& name, const std::string& content);
  void write_series(const std::string& name, const Series& series);
  void remove_stale(bool earlier_run) const;

  std::filesystem::path folder_;
  OutputSettings settings_;
  std::optional<FolderLock> lock_;
  bool committed_ = false;
  std::vector<std::filesystem::path> created_;  // folders that were not there before
  std::vector<std::string> files_;              // names, written as partial so far
  Series bodies_, surfaces_;
};

}  // namespace kerf
