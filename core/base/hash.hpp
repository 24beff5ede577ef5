// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace kerf {

/// FNV-1a, byte by byte as they lie in memory: tells states apart, and is not for security.
/// Source  Fowler, Noll, Vo: 64 bits, offset basis and prime of theirs.
class Hash {
 public:
  template <class T>
  void add(const std::vector<T>& values) {
    static_assert(std::is_floating_point_v<T> || std::has_unique_object_representations_v<T>,
                  "bytes between members would be hashed");
    const auto* at = reinterpret_cast<const unsigned char*>(values.data());
    for (std::size_t i = 0; i < values.size() * sizeof(T); ++i)
      value_ = (value_ ^ at[i]) * 0x100000001B3U;
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325U;
};

}  // namespace kerf
