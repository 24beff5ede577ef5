// SPDX-License-Identifier: MIT
//
// Threads that find no memory for their buffers: an exception of the call, not the end of the
// process.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "tests/support/problem.hpp"

namespace {
std::atomic<bool> refuse = false;
}

// The buffers of threads, and little else, are allocated with an alignment.
void* operator new(std::size_t size, std::align_val_t align) {
  const auto unit = static_cast<std::size_t>(align);
  void* const out = refuse ? nullptr : std::aligned_alloc(unit, (size + unit - 1) / unit * unit);
  if (out == nullptr) throw std::bad_alloc();
  return out;
}
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace kerf {
namespace {

/// One of the first calls of a process, so that no thread has buffers yet.
template <class Call>
void expect_refused(const Call& call) {
  refuse = true;
  EXPECT_THROW(call(), std::bad_alloc);
  refuse = false;
}

TEST(OutOfMemory, IsAnExceptionOfTheCallOnAnyNumberOfThreads) {
  test::ProblemOptions options;
  options.coarsest_vertices = 60;
  options.with_oracle = false;
  const test::Problem p(LinkedOctree(test::box_body({40, 30, 20}), 0), options);
  const auto fast = test::make_backend("mixed", 3), reference = test::make_backend("cpu");
  const int u = fast->add_vector();
  for (Backend* backend : {fast.get(), reference.get()}) {
    backend->load(p.hierarchy);
    backend->set_operator({1, 0});
  }
  test::write(*fast, 0, u, p.deformation());
  for (const int x : {kSolution, kRight}) test::write(*fast, 0, x, p.free_vector(0, 2 + x));
  expect_refused([&] { fast->restrict_from_solution(0); });
  test::write(*fast, 0, kResidual, p.free_vector(0, 1));
  expect_refused([&] { fast->restrict_residual(0); });
  expect_refused([&] { fast->rotate_cells(u); });
  expect_refused([&] { fast->apply(0, kResidual, kScratch); });
  expect_refused([&] { fast->prepare(0); });

  // Values that are only read are as they were.
  test::write(*reference, 0, kResidual, p.free_vector(0, 1));
  for (Backend* backend : {fast.get(), reference.get()}) backend->apply(0, kResidual, kScratch);
  const auto found = p.read(*fast, 0, kScratch), expected = p.read(*reference, 0, kScratch);
  EXPECT_LE((found - expected).norm(), 1e-5 * expected.norm());
  for (const int x : {kSolution, kRight}) test::write(*reference, 0, x, p.free_vector(0, 2 + x));
  for (Backend* backend : {fast.get(), reference.get()}) backend->restrict_from_solution(0);
  const auto given = p.read(*fast, 1, kRight), due = p.read(*reference, 1, kRight);
  EXPECT_LE((given - due).norm(), 1e-5 * due.norm());
}

}  // namespace
}  // namespace kerf
