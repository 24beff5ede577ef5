// SPDX-License-Identifier: MIT
#include "bench/trial.hpp"

#include "app/backends.hpp"
#include "gpu/cuda_backend.hpp"

namespace kerf::bench {
namespace {

// Also those that are there for comparison alone.
std::unique_ptr<Backend> make_any_backend(const SolverSetup& setup) {
  if (setup.backend == "cuda-records")
    return make_cuda_backend(
        {.single_cycle = setup.precision == Precision::mixed, .records = true});
  return make_backend(setup);
}

}  // namespace

Machine::Machine(const Body& body, const SolverSetup& setup)
    : body_(body), backend_(make_any_backend(setup)) {
  load_vector = backend_->add_vector();
  bent = backend_->add_vector();
  solution = backend_->add_vector();
}

void Machine::load() {
  backend_->load(body_.hierarchy());
  backend_->set_operator({});
  backend_->write(0, load_vector, body_.load());
  backend_->mask(0, load_vector);
  if (rotations_before.empty()) {
    backend_->write(0, bent, body_.bent(0.9));
    backend_->rotate_cells(bent);
    rotations_before.resize(4 * body_.cells());
    backend_->read_rotations(rotations_before);
  } else {
    backend_->write_rotations(rotations_before);
  }
  backend_->write(0, bent, body_.bent(1));
  backend_->rotate_cells(bent);
  find_values(body_.hierarchy());
}

void Machine::find_values(const Hierarchy& hierarchy) {
  backend_->prepare(0);
  for (int level = 0; level + 1 < static_cast<int>(hierarchy.levels.size()); ++level) {
    backend_->coarsen(level);
    backend_->prepare(level + 1);
  }
  backend_->factor_coarsest();
}

void Trial::drop() {
  solver.reset();
  dense.reset();
  octree.reset();
  surface.reset();
  dense_in = dense_out = {};
  positions = normals = {};
}

void Trial::use_smoother(SmootherType type) {
  SmootherOptions options = smoother_options(candidate.solver);
  options.chebyshev = type == SmootherType::chebyshev;
  backend().set_smoother(options);
}

Cycle Trial::cycle() {
  return Cycle(backend(), machine.levels(), cycle_options(candidate.solver, body.hierarchy()));
}

std::vector<double> Trial::read(int level, int x) {
  std::vector<double> out(3 * body.hierarchy().levels[level].point.size());
  backend().read(level, x, out);
  return out;
}

}  // namespace kerf::bench
