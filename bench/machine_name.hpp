// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace kerf::bench {

/// A short name of this machine: processor, widest vector instructions, cores, as in
/// "epyc-avx2-2core".
std::string machine_name();

/// The part of it that comes from the model name of a processor: without maker and clock.
std::string short_processor_name(const std::string& model);

}  // namespace kerf::bench
