// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace kerf::cpu {

/// Numbers of a few out of many keys: a hash table with open places, so that threads that number
/// patches need no array as long as the level. Keys are not negative.
class NumberTable {
 public:
  /// The number of a key, to be set by the caller; -1 if the key is new. Holds until the next call.
  std::int32_t& operator[](std::int32_t key) {
    if (2 * used_ >= places_.size()) grow();
    Place& place = find(key);
    if (place.key < 0) {
      place.key = key;
      ++used_;
    }
    return place.number;
  }
  void clear() {
    std::fill(places_.begin(), places_.end(), Place{});
    used_ = 0;
  }

 private:
  struct Place {
    std::int32_t key = -1, number = -1;
  };

  Place& find(std::int32_t key) {
    constexpr std::uint32_t kGolden = 0x9E3779B9U;  // neighbours go far apart
    const std::size_t mask = places_.size() - 1;
    std::size_t at = static_cast<std::uint32_t>(key) * kGolden >> 8 & mask;
    while (places_[at].key >= 0 && places_[at].key != key) at = (at + 1) & mask;
    return places_[at];
  }
  void grow() {
    constexpr std::size_t kLeast = 1024;
    std::vector<Place> old(std::max(kLeast, 2 * places_.size()));
    old.swap(places_);
    for (const Place& place : old)
      if (place.key >= 0) find(place.key) = place;
  }

  std::vector<Place> places_;  // a power of two
  std::size_t used_ = 0;
};

}  // namespace kerf::cpu
