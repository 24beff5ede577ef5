// SPDX-License-Identifier: MIT
//
// Bodies with cuts whose answers are known.
#pragma once

#include <string>
#include <vector>

#include "bench/cutting/record.hpp"

namespace kerf::cutting {

struct Scene {
  const char* name;
  const char* what;        ///< body and answer
  const char* size_of;     ///< what `size` counts cells along
  std::vector<int> sizes;  ///< of a full run, ascending; the smallest is that of the tests
  Record (*run)(Method method, int size, int threads);
};

const std::vector<Scene>& scenes();
const Scene& find_scene(const std::string& name);  ///< throws Error (bad_input)

/// Runs a scene and fills in who and how.
Record run_scene(const Scene& scene, Method method, int size, int threads);

// One function for each scene; `value` is in m unless said otherwise.
Record bar_on_grid(Method method, int size, int threads);
Record bar_between(Method method, int size, int threads);
Record rods_on_grid(Method method, int size, int threads);
Record rods_between(Method method, int size, int threads);
Record double_cantilever(Method method, int size, int threads);
Record penny_crack(Method method, int size, int threads);   ///< value: its volume, m^3
Record tilted_crack(Method method, int size, int threads);  ///< value: mean volume, m^3
Record cut_orders(Method method, int size, int threads);

}  // namespace kerf::cutting
