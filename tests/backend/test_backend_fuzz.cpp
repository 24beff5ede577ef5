// SPDX-License-Identifier: MIT
//
// Anything that a body may go through, in any order: cuts, supports that come and go, another
// operator, other rotations, a second body. After it a backend is as one that never saw anything
// else, and in double as the reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/random_blades.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Dice;
using test::Problem;
using test::relative;

constexpr std::uint64_t kFirstSeed = 20261128;
constexpr int kEvents = 12;

/// What a result may be off by, of its greatest entry.
struct Tolerances {
  double product, inverse, transfer;
};
constexpr Tolerances kDouble{1e-12, 1e-9, 1e-13};
// Entries of a matrix are one more or less of 32767 where sums have another order. In 2700 states
// that made products 1e-3 of their greatest entry others, where these are small.
constexpr Tolerances kMixed{2e-3, 2e-2, 2e-6};
// What single precision takes for singular, double may invert.
constexpr Tolerances kMixedLikeReference{2e-3, 1e300, 2e-6};

struct Machine {
  const char* backend;
  bool single;  ///< mixed precision
};

/// How cells turn.
enum class Turns { as_one, nearly_as_one, each, differently };

std::unique_ptr<Problem> random_problem(Dice& dice) {
  test::ProblemOptions options;
  constexpr test::Holds kHolds[] = {test::Holds::none, test::Holds::one_side, test::Holds::mixed,
                                    test::Holds::slides};
  options.holds = kHolds[dice.roll(4)];
  options.lumped_mass = dice.roll(2) == 0;
  options.coarsest_vertices = 1;
  options.max_levels = 2 + dice.roll(3);
  options.materials = 1 + dice.roll(3);
  options.with_oracle = false;
  // Large ones have several patches, most of which a small blade leaves as they are but for some
  // cells.
  constexpr Vec3i kLarge{40, 30, 24}, kMiddle{29, 18, 13};
  const int size = dice.roll(4);
  const Voxels voxels = size == 0   ? test::box_body(kLarge)
                        : size == 1 ? test::box_body(kMiddle)
                                    : test::random_body(dice);
  return std::make_unique<Problem>(LinkedOctree(voxels, dice.roll(3)), options);
}

std::vector<double> random_rotations(const Problem& p, Dice& dice, Turns turns) {
  const Level& finest = p.level(0);
  const double start = dice.between(-2, 2), any = 0.02 * std::pow(10, dice.between(-3, 0));
  const double spread = turns == Turns::nearly_as_one ? any : turns == Turns::differently ? 1 : 0;
  const int wild = turns == Turns::each ? 99 : turns == Turns::differently ? 9 : 0;
  std::vector<double> out;
  out.reserve(4 * std::size_t(finest.cells()));
  for (std::int32_t c = 0; c < finest.cells(); ++c) {
    const Vec3i& at = finest.corner[c];
    const double half = at[0] < wild ? dice.between(-2, 2)
                                     : start + spread * std::sin(0.1 * (at[0] + 2 * at[1] + at[2]));
    for (const double part :
         {std::cos(half), 0.48 * std::sin(half), 0.6 * std::sin(half), 0.64 * std::sin(half)})
      out.push_back(part);
  }
  return out;
}

struct Results {
  std::vector<Vector> products, inverses, transfers;
};

/// All that depends on values or on the structure, of every level.
Results results_of(const Problem& p, Backend& backend) {
  Results out;
  backend.prepare(0);
  for (int l = 0; l < p.levels(); ++l) {
    if (l > 0) backend.coarsen(l - 1), backend.prepare(l);
    test::write(backend, l, kKrylovX, p.free_vector(l, 7));
    backend.apply(l, kKrylovX, kKrylovV);
    out.products.push_back(p.read(backend, l, kKrylovV));
    backend.precondition_jacobi(l, kKrylovX, kKrylovV);
    out.inverses.push_back(p.read(backend, l, kKrylovV));
  }
  for (int l = 0; l + 1 < p.levels(); ++l) {
    test::write(backend, l, kResidual, p.free_vector(l, 8));
    backend.restrict_residual(l);
    out.transfers.push_back(p.read(backend, l + 1, kRight));
    test::write(backend, l + 1, kSolution, p.free_vector(l + 1, 9));
    test::write(backend, l, kSolution, p.free_vector(l, 10));
    backend.prolong_correction(l);
    out.transfers.push_back(p.read(backend, l, kSolution));
    test::write(backend, l, kRight, p.free_vector(l, 11));
    backend.restrict_from_solution(l);
    out.products.push_back(p.read(backend, l + 1, kRight));
  }
  return out;
}

void expect_alike(const Results& found, const Results& expected, const Tolerances& within) {
  const auto compare = [](const std::vector<Vector>& a, const std::vector<Vector>& b,
                          double tolerance, const char* what) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t n = 0; n < a.size(); ++n) {
      if (b[n].lpNorm<Eigen::Infinity>() > 0) {
        ASSERT_LE(relative(a[n], b[n]), tolerance) << what << " " << n;
      } else {
        ASSERT_EQ(a[n], b[n]) << what << " " << n;
      }
    }
  };
  ASSERT_NO_FATAL_FAILURE(compare(found.products, expected.products, within.product, "product"));
  ASSERT_NO_FATAL_FAILURE(compare(found.inverses, expected.inverses, within.inverse, "inverse"));
  compare(found.transfers, expected.transfers, within.transfer, "transfer");
}

class BackendFuzz : public ::testing::TestWithParam<Machine> {
 protected:
  /// A new body, for a backend that perhaps has one.
  void begin(Dice& dice) {
    problem_ = random_problem(dice);
    blades_ = std::make_unique<test::RandomBlades>(problem_->body.lattice(), dice);
    cuts_ = 0;
    load(dice);
  }
  void load(Dice& dice) {
    backend_->load(problem_->hierarchy);
    backend_->set_operator(scale_);
    turn(dice);
  }
  // Single precision turns sixteen coarse cells as one or none of them, and which are together
  // depends on what came before: no cells that turn alike beside others.
  void turn(Dice& dice) {
    turns_ = static_cast<Turns>(dice.roll(GetParam().single ? 3 : 4));
    backend_->write_rotations(random_rotations(*problem_, dice, turns_));
  }
  /// Single precision takes those that turn nearly as one for one.
  bool is_like_reference() const { return !GetParam().single || turns_ == Turns::as_one; }
  void cut_and_hold(Dice& dice) {
    std::vector<std::int32_t> turned;
    const int count = dice.roll(4) == 0 ? 1 + dice.roll(5) : 0;
    for (int k = 0; k < count; ++k) turned.push_back(dice.roll(problem_->level(0).vertices()));
    std::sort(turned.begin(), turned.end());
    turned.erase(std::unique(turned.begin(), turned.end()), turned.end());
    const auto bits = static_cast<std::uint8_t>(1 + dice.roll(7));
    const bool follows =
        problem_->update(updater_, cut(problem_->body, {}, blades_->next(), ++cuts_), turned, bits);
    if (follows) return backend_->update(problem_->hierarchy, updater_.change());
    build_coarse_levels(problem_->hierarchy, problem_->hierarchy_options());
    problem_->hierarchy.pack();
    load(dice);
  }
  void change_operator(Dice& dice) {
    scale_ = dice.roll(3) == 0 ? OperatorScale{1, 0} : OperatorScale{0.8, 100.0 * dice.roll(9)};
    backend_->set_operator(scale_);
  }

  /// A backend that knows this state alone.
  Results of_fresh(const char* name) const {
    const auto fresh = test::make_backend(name);
    fresh->load(problem_->hierarchy);
    fresh->set_operator(scale_);
    std::vector<double> rotations(4 * problem_->hierarchy.values.size());
    backend_->read_rotations(rotations);
    fresh->write_rotations(rotations);
    return results_of(*problem_, *fresh);
  }

  std::unique_ptr<Backend> backend_;
  std::unique_ptr<Problem> problem_;
  std::unique_ptr<test::RandomBlades> blades_;
  LevelUpdater updater_;
  OperatorScale scale_{0.8, 400};
  Turns turns_ = Turns::as_one;
  int cuts_ = 0;
};

TEST_P(BackendFuzz, IsAsIfItHadNeverSeenAnythingElse) {
  const Machine& machine = GetParam();
  const int events = test::blade_count(60);
  for (int done = 0; done < events; done += kEvents) {
    const std::uint64_t seed = kFirstSeed + static_cast<std::uint64_t>(done);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Dice dice(seed);
    backend_ = test::make_backend(machine.backend, 1 + dice.roll(2));
    begin(dice);
    for (int i = 0; i < kEvents; ++i) {
      const int event = dice.roll(12);
      SCOPED_TRACE(testing::Message() << "event " << i << " of kind " << event);
      if (event < 7)
        cut_and_hold(dice);
      else if (event < 9)
        turn(dice);
      else if (event < 11)
        change_operator(dice);
      else
        begin(dice);
      if (dice.roll(3) == 0) continue;  // what comes next finds values that were never made
      const Tolerances& within = machine.single ? kMixed : kDouble;
      const Results found = results_of(*problem_, *backend_);
      ASSERT_NO_FATAL_FAILURE(expect_alike(found, of_fresh(machine.backend), within));
      if (!is_like_reference()) continue;
      const Tolerances& of_reference = machine.single ? kMixedLikeReference : kDouble;
      ASSERT_NO_FATAL_FAILURE(expect_alike(found, of_fresh("cpu"), of_reference));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, BackendFuzz,
                         ::testing::Values(Machine{"fast", false}, Machine{"mixed", true},
                                           Machine{"mirror", false}, Machine{"mirror_mixed", true}),
                         [](const auto& machine) { return std::string(machine.param.backend); });

}  // namespace
}  // namespace kerf
