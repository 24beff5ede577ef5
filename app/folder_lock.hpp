// SPDX-License-Identifier: MIT
//
// One process at a time writes into a folder.
#pragma once

#include <filesystem>

namespace kerf {

/// Holds the lock of a folder that exists, as long as it lives. It leaves no file, and is gone with
/// the process, however that ends. Where the folder cannot be opened or its file system knows no
/// locks, nothing is held.
class FolderLock {
 public:
  /// @throws Error (bad_input) if another process, or another lock of this one, holds it.
  explicit FolderLock(std::filesystem::path folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  /// Whether the path still names the folder that was locked, not one that was made in its place.
  bool is_in_place() const;

 private:
  std::filesystem::path path_;
  int folder_ = -1;
};

}  // namespace kerf
