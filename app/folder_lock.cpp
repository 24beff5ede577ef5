// SPDX-License-Identifier: MIT
#include "app/folder_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "core/base/error.hpp"

namespace kerf {

FolderLock::FolderLock(std::filesystem::path folder)
    : path_(std::move(folder)), folder_(open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  const bool is_held =
      folder_ >= 0 && flock(folder_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  // The run that held it may have taken its folder away in between.
  if (!is_held && is_in_place()) return;
  close(folder_);
  throw Error(ErrorKind::bad_input,
              text(path_.string(),
                   ": another kerf writes into this folder; wait until it ends, or "
                   "name another one with --out"));
}

FolderLock::~FolderLock() {
  if (folder_ >= 0) close(folder_);
}

bool FolderLock::is_in_place() const {
  if (folder_ < 0) return true;
  struct stat locked {
  }, named{};
  return fstat(folder_, &locked) == 0 && stat(path_.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

}  // namespace kerf
