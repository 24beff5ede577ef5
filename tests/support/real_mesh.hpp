// SPDX-License-Identifier: MIT
//
// Where real meshes are, if anywhere: KERF_MESHES, else ../shared/meshes beside the sources.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace kerf::test {

/// May name a file that does not exist; the test then skips and says so.
inline std::filesystem::path real_mesh(const char* file) {
  const char* folder = std::getenv("KERF_MESHES");
  return (folder != nullptr ? std::filesystem::path(folder)
                            : std::filesystem::path(KERF_SOURCE_DIR) / ".." / "shared" / "meshes") /
         file;
}

}  // namespace kerf::test
