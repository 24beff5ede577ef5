// SPDX-License-Identifier: MIT
//
// The bodies that the bench runs, by name, as set-ups of simulations. All stand on y = 0 and are
// held there.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/setup.hpp"

namespace kerf::bench {

struct SceneInfo {
  const char* name;
  const char* what;
  bool solve_only = false;  ///< too large to repeat every phase
};
const std::vector<SceneInfo>& scenes();

/// `small`: the smallest size that still has all parts of the scene, for tests.
enum class Size { full, small };
/// @throws Error (bad_input) for a value of --size that is neither.
Size size_named(const std::string& name);

/// The scene at the given size; cuts are meant in the reference state. Empty if its mesh lies in
/// none of `folders`; `missing` then names the file.
/// Needs  a name out of scenes().
std::optional<SimulationSetup> make_scene(const std::string& name, Size size,
                                          const std::vector<std::filesystem::path>& folders,
                                          std::string& missing);

/// Where real meshes may be: `given` (--meshes, with ':' between folders) alone if not empty, else
/// $KERF_MESHES, else
/// ../shared/meshes beside the sources.
std::vector<std::filesystem::path> mesh_folders(const std::string& given);

}  // namespace kerf::bench
