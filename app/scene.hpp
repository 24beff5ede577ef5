// SPDX-License-Identifier: MIT
//
// Scene files: what `kerf run` is asked to do. docs/scene.md lists every key.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/setup.hpp"

namespace kerf {

struct OutputSettings {
  int every = 1;        ///< files every so many steps; of the first and last state always
  bool vtu = true;      ///< body_NNNN.vtu
  bool vtp = true;      ///< surface_NNNN.vtp; this and the next two need a surface
  bool ply = false;     ///< surface_NNNN.ply
  bool glb = false;     ///< surface_NNNN.glb
  bool levels = false;  ///< level_K_NNNN.vtu, for figures
  bool links = false;   ///< links_NNNN.vtp, for figures
  bool pvd = true;      ///< body.pvd and surface.pvd, the series for ParaView of vtu and vtp
  bool preview = true;  ///< preview.png
};

struct Scene {
  std::string title;
  std::filesystem::path file;
  SimulationSetup setup;
  OutputSettings output;
  /// Where each key that was given stands: "solver.precision" -> "scene.toml:40", or
  /// "--set solver.precision=mixed". Entries of arrays are counted from 0: "cut.0.start".
  std::map<std::string, std::string> places;

  /// The place of `key`, else of what encloses it, else the file.
  std::string place_of(const std::string& key) const;
};

/// Reads a scene and applies `overrides` ("section.key=value", values in TOML, a bare word is a
/// string). Paths in the scene are relative to the folder of the scene file. Reads the meshes.
/// @throws Error (bad_input) with "FILE:LINE: " or "--set ...: " in front.
Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

/// The same from text; `file` is used for messages and for relative paths.
Scene read_scene_text(const std::string& toml, const std::filesystem::path& file,
                      const std::vector<std::string>& overrides = {});

}  // namespace kerf
