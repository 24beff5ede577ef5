// SPDX-License-Identifier: MIT
//
// Backends by the names that scene files use.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/backend.hpp"
#include "core/setup.hpp"

namespace kerf {

/// "cpu"; "cuda" if it was built and a device is present; "auto": that one, else "cpu".
/// @throws Error (unavailable) for a backend that is not there; Error (bad_input) for a precision
/// that the backend does not offer.
std::unique_ptr<Backend> make_backend(const SolverSetup& solver);

/// Why "auto" takes the CPU; empty where it takes a GPU, and of all other names.
std::string why_on_cpu(const SolverSetup& solver);

/// Name and state of each backend, for `kerf info`.
std::vector<std::pair<std::string, std::string>> backend_states();

const char* precision_name(Precision precision);

}  // namespace kerf
