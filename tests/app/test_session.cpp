// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "app/backends.hpp"
#include "app/session.hpp"
#include "core/base/error.hpp"
#include "gpu/cuda_backend.hpp"
#include "tests/support/mirror_backend.hpp"

namespace kerf {
namespace {

Scene scene(const std::string& backend) {
  return read_scene_text(R"(
[body]
shape = "box"
size = [0.1, 0.1, 0.1]
resolution = 6
[[support]]
box = [[-1, -1, -1], [1, 0.001, 1]]
)",
                         "scene.toml", {"solver.backend=" + backend});
}

/// A device that is too small for any body.
std::unique_ptr<Backend> small_device() {
  test::MirrorOptions options;
  options.memory = std::size_t{410} << 10;
  return test::make_mirror_backend(false, options);
}

TEST(Session, AutoGoesOnOnTheCpuWhereTheBodyIsTooLargeForTheGpu) {
  Simulation simulation = open_simulation(scene("auto"), small_device());

  EXPECT_EQ(simulation.backend().name(), std::string("cpu"));
  EXPECT_TRUE(simulation.step().converged);
}

TEST(Session, AutoGoesOnOnTheCpuWhereTheMemoryOfTheGpuEndsInTheMiddleOfARun) {
  test::MirrorOptions options;
  const Simulation whole = open_simulation(scene("auto"), test::make_mirror_backend(false));
  options.allocations = test::counters_of(const_cast<Backend&>(whole.backend())).allocations;
  Simulation simulation = open_simulation(scene("auto"), test::make_mirror_backend(false, options));
  ASSERT_EQ(simulation.backend().name(), std::string("mirror"));

  EXPECT_TRUE(simulation.step().converged);

  EXPECT_EQ(simulation.backend().name(), std::string("cpu"));
  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_NE(simulation.warnings()[0].find("goes on with backend cpu"), std::string::npos);
}

TEST(Session, ABackendThatWasNamedIsNotReplaced) {
  EXPECT_THROW(open_simulation(scene("cuda"), small_device()), Error);
}

TEST(Backends, AutoTakesTheCpuWhereThereIsNoGpuAndSaysWhy) {
  SolverSetup setup;
  setup.backend = "auto";
  const std::string name = make_backend(setup)->name();

  EXPECT_EQ(name, cuda_problem().empty() ? "cuda" : "cpu");
  EXPECT_EQ(why_on_cpu(setup), cuda_problem());
  setup.backend = "cpu";
  EXPECT_EQ(why_on_cpu(setup), "");
}

TEST(Backends, CudaThatIsNotThereIsAnErrorThatSaysWhyAndWhatElseToSet) {
  if (cuda_problem().empty()) GTEST_SKIP() << "there is a GPU";
  SolverSetup setup;
  setup.backend = "cuda";
  try {
    make_backend(setup);
    FAIL() << "a backend without a GPU";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
    const std::string what = error.what();
    EXPECT_NE(what.find(cuda_problem()), std::string::npos) << what;
    EXPECT_NE(what.find("\"cpu\""), std::string::npos) << what;
  }
}

}  // namespace
}  // namespace kerf
