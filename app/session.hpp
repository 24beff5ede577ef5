// SPDX-License-Identifier: MIT
//
// From a scene to a simulation, with the place in the scene in front of every complaint.
#pragma once

#include "app/scene.hpp"
#include "core/simulation.hpp"

namespace kerf {

/// @throws Error (bad_input, unavailable) that begins with a place in the scene.
std::unique_ptr<Backend> open_backend(const Scene& scene);
/// Where "auto" chose a GPU whose memory does not hold the body: on the CPU, with a warning on the
/// standard error.
Simulation open_simulation(const Scene& scene, std::unique_ptr<Backend> backend);

/// "12.3 MB"
std::string bytes_text(std::size_t bytes);

/// The complaint about blades that met no link of the body in the whole run, one line for each
/// such cut; empty if there is none. `hits` counts the links met, per cut.
std::string missed_blades(const Scene& scene, const std::vector<std::size_t>& hits,
                          const Box3& body);

}  // namespace kerf
