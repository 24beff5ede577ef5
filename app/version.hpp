// SPDX-License-Identifier: MIT
//
// What this program was built from, and how. Filled by app/version.cpp.in while configuring.
#pragma once

namespace kerf {

extern const char* const kVersion;    ///< "0.1.0"
extern const char* const kCommit;     ///< of git while configuring, or "unknown"
extern const char* const kCompiler;   ///< "GNU 12.2.0"
extern const char* const kBuildType;  ///< "Release"
extern const char* const kSystem;     ///< "Linux x86_64"
extern const char* const kLibraries;  ///< names and versions
extern const bool kHasPreview;

}  // namespace kerf
