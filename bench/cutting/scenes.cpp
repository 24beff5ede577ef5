// SPDX-License-Identifier: MIT
#include "bench/cutting/scenes.hpp"

#include "core/base/error.hpp"

namespace kerf::cutting {

const std::vector<Scene>& scenes() {
  static const std::vector<Scene> all{
      {"bar",
       "a bar cut in two on a plane of the grid: one half hangs, the other stands",
       "the width",
       {4, 8, 16, 32},
       bar_on_grid},
      {"bar-between",
       "the same, cut a third of a cell beside a plane of the grid",
       "the width",
       {4, 8, 16, 32},
       bar_between},
      {"cantilevers",
       "two arms above and below a slit, pulled apart, against fracture mechanics",
       "an arm's height",
       {4, 8, 16, 32},
       double_cantilever},
      {"penny",
       "a round crack under pressure, against Sneddon's opening",
       "the radius",
       {4, 8, 16, 32},
       penny_crack},
      {"rods",
       "a block cut into 3 x 3 rods, eight times as long as wide, against beam theory",
       "a rod's width",
       {2, 4, 8, 16},
       rods_on_grid},
      {"rods-between",
       "the same, cut a third of a cell beside planes of the grid",
       "a rod's width",
       {2, 4, 8, 16},
       rods_between},
      {"orders",
       "parallel and crossing cuts in four orders, against the first",
       "the edge",
       {8, 16, 32},
       cut_orders},
      {"tilted",
       "the round crack tilted by 0, 15, ... 90 degrees",
       "the radius",
       {4, 8, 16},
       tilted_crack}};
  return all;
}

const Scene& find_scene(const std::string& name) {
  for (const Scene& scene : scenes())
    if (name == scene.name) return scene;
  throw Error(ErrorKind::bad_input, text("no scene '", name, "'"));
}

Record run_scene(const Scene& scene, Method method, int size, int threads) {
  Record out = scene.run(method, size, threads);
  out.scene = scene.name;
  out.method = name_of(method);
  out.size = size;
  out.threads = threads;
  return out;
}

}  // namespace kerf::cutting
