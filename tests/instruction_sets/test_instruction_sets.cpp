// SPDX-License-Identifier: MIT
//
// Every instruction set that this build has code for and this machine can run: one in a build for
// one kind of machine, several in a build for distribution.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/base/error.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Problem;

constexpr const char* kVariable = "KERF_INSTRUCTION_SET";

std::unique_ptr<Backend> make(const std::string& set, bool single = false, int threads = 1) {
  return make_fast_backend({threads, single, true, set});
}

/// A value of the variable while the object lives.
class Environment {
 public:
  explicit Environment(const char* value) {
    if (const char* before = std::getenv(kVariable)) before_ = before;
    setenv(kVariable, value, 1);
  }
  ~Environment() {
    if (before_.empty())
      unsetenv(kVariable);
    else
      setenv(kVariable, before_.c_str(), 1);
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  std::string before_;
};

/// One solve by conjugate gradients with a K-cycle.
Vector solve(const Problem& p, std::unique_ptr<Backend> backend, double tolerance) {
  SolverSetup setup;
  setup.cycle = CycleType::k;
  const test::Solved solved = test::solve(p, *backend, setup, {0.8, 400}, tolerance);
  EXPECT_TRUE(solved.stats.converged);
  return solved.x;
}

TEST(InstructionSets, EachSolvesAsTheReference) {
  const Problem p = test::large_cut_block();
  // The residual times the condition of the body.
  constexpr double kTolerance = 1e-9, kOfTheSolver = 1e-6;
  const Vector expected = solve(p, make_cpu_backend({1, 0}), kTolerance);
  for (const std::string& set : fast_instruction_sets())
    for (const bool single : {false, true}) {
      auto backend = make(set, single);
      EXPECT_EQ(backend->instruction_set(), set);
      const Vector found = solve(p, std::move(backend), kTolerance);
      EXPECT_LE((found - expected).lpNorm<Eigen::Infinity>(),
                kOfTheSolver * expected.lpNorm<Eigen::Infinity>())
          << set << (single ? ", mixed" : "");
    }
}

// Packs of baseline and AVX2 have one width, those of AVX-512 another (cpu/pack.hpp), and fma is
// written out.
TEST(InstructionSets, GiveTheSameBitsAsEachOtherForAnyNumberOfThreads) {
  const Problem p = test::large_cut_block();
  constexpr double kTolerance = 1e-3;  // bits show it after a few cycles
  const std::vector<std::string> sets = fast_instruction_sets();
  for (const bool single : {false, true})
    for (const std::string& set : sets) {
      const std::string& like = set == "avx512" ? set : sets.front();
      const Vector first = solve(p, make(like, single), kTolerance);
      for (const int threads : {1, 2, 4}) {
        const Vector other = solve(p, make(set, single, threads), kTolerance);
        EXPECT_EQ(std::memcmp(other.data(), first.data(), sizeof(double) * p.unknowns(0)), 0)
            << set << (single ? ", mixed, " : ", ") << threads << " threads";
      }
    }
}

// The code of each set has types of its own; an exception must still be known outside.
TEST(InstructionSets, ErrorsOfEachAreCaught) {
  for (const std::string& set : fast_instruction_sets()) {
    SCOPED_TRACE(set);
    SmootherOptions gauss_seidel;
    gauss_seidel.chebyshev = false;
    const auto backend = make(set);
    try {
      backend->set_smoother(gauss_seidel);
      ADD_FAILURE() << "not refused";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::bad_input);
      EXPECT_NE(std::string(error.what()).find("Gauss-Seidel"), std::string::npos);
    }
    EXPECT_THROW(make(set, false, 5000), Error) << "thrown by a constructor";
  }
}

TEST(InstructionSets, TheBestIsChosenUnlessTheEnvironmentOrTheCallerSaysOtherwise) {
  const std::vector<std::string> sets = fast_instruction_sets();
  ASSERT_FALSE(sets.empty());
  {
    const Environment none("");
    EXPECT_EQ(make("")->instruction_set(), sets.back());
  }
  for (const std::string& set : sets) {
    const Environment wish(set.c_str());
    EXPECT_EQ(make("")->instruction_set(), set);
    EXPECT_EQ(make(sets.front())->instruction_set(), sets.front()) << "the caller goes first";
  }
}

TEST(InstructionSets, AWishThatCannotBeHadSaysWhatThereIs) {
  const std::vector<std::string> sets = fast_instruction_sets();
  for (const std::string wish : {"baseline", "avx2", "avx512", "abacus"}) {
    if (std::find(sets.begin(), sets.end(), wish) != sets.end()) continue;
    const Environment wrong(wish.c_str());
    try {
      make("");
      ADD_FAILURE() << wish << " was not refused";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), wish == "abacus" ? ErrorKind::bad_input : ErrorKind::unavailable);
      for (const std::string& part : sets)
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(kVariable), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace kerf
