// SPDX-License-Identifier: MIT
//
// Writing a file to its end, or saying why that failed.
#pragma once

#include <filesystem>
#include <functional>
#include <ostream>

namespace kerf {

/// Creates or replaces `file` with the bytes that `write` puts out.
/// @throws Error (bad_input) with the system's reason if not all of them reach the file.
void write_file(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write);

}  // namespace kerf
