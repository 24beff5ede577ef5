// SPDX-License-Identifier: MIT
//
// A list of launches as data: what one launch runs from beginning to end on levels that are too
// small to fill a device, where launches of their own would cost more than their work. All threads
// finish an entry before any begins the next.
#pragma once

#include <cstring>
#include <type_traits>

#include "gpu/bodies/dense.hpp"
#include "gpu/bodies/products.hpp"
#include "gpu/bodies/vectors.hpp"

namespace kerf::gpu {

/// One launch: a body of one of the types of a list.
struct alignas(16) ProgramEntry {
  static constexpr std::size_t kBytes = 256;
  unsigned char body[kBytes];
  std::int32_t kind, count;
};

template <class... Bodies>
struct BodyList {
  /// Place of a type; -1: it is none of them.
  template <class Body>
  static constexpr int index_of() {
    int at = 0, found = -1;
    ((found = std::is_same_v<Body, Bodies> ? at : found, ++at), ...);
    return found;
  }
};

/// All that a cycle launches below level 0.
template <class S>
using CycleBodies =
    BodyList<RecordCell<S, StoredCells<S>>, GatherVertex<S, SumTo<S>>,
             GatherVertex<S, ResidualTo<S>>, GatherVertex<S, ChebyshevTo<S>>,
             EachVertex<S, ChebyshevTo<S>>, RelaxVertex<S, false>, RestrictCell<S>,
             ProlongVertex<S>, DenseSlice<S>, DenseSum<S>, ZeroBody<S>, CopyBody<S, S>,
             CombineBody<S, S>, PartialSums<TwoDotTerms<S, S>>, PartialSums<ThreeDotTerms<S>>,
             FoldSums, TotalSums<2, KrylovFirst>, TotalSums<3, KrylovSecond>>;

template <class List, class Body>
ProgramEntry program_entry(std::int32_t count, const Body& body) {
  static_assert(std::is_trivially_copyable_v<Body> && sizeof(Body) <= ProgramEntry::kBytes);
  ProgramEntry out{};
  std::memcpy(out.body, &body, sizeof body);
  out.kind = List::template index_of<Body>();
  out.count = count;
  return out;
}

/// f(body), on the host; a device has the same in cuda_device.cuh.
template <class F, class... Bodies>
void visit_body(BodyList<Bodies...>, const ProgramEntry& entry, const F& f) {
  int kind = 0;
  ((kind++ == entry.kind ? f(*reinterpret_cast<const Bodies*>(entry.body)) : void()), ...);
}

}  // namespace kerf::gpu
