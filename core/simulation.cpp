// SPDX-License-Identifier: MIT
#include "core/simulation.hpp"

#include <utility>

#include "core/base/hash.hpp"
#include "core/levels/corners.hpp"
#include "core/simulation_impl.hpp"
#include "core/snapshot.hpp"
#include "kernels/mat3.hpp"

namespace kerf {

Simulation::Simulation(SimulationSetup setup, std::unique_ptr<Backend> backend) {
  expects(backend != nullptr, "Simulation needs a backend; see make_fast_backend");
  validate(setup);
  impl_ = std::make_unique<Impl>(std::move(setup), std::move(backend));
  impl_->start();
}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

bool Simulation::finished() const {
  return impl_->stopped || impl_->steps >= impl_->schedule.steps();
}
int Simulation::steps_planned() const { return impl_->schedule.steps(); }
StepReport Simulation::step() {
  expects(!impl_->broken, "this simulation threw during a step; make a new one");
  impl_->broken = true;  // until the step comes back
  StepReport report = impl_->step();
  impl_->broken = false;
  return report;
}
void Simulation::on_progress(Progress progress) { impl_->progress = std::move(progress); }
void Simulation::set_fallback(Fallback make) { impl_->fallback = std::move(make); }
double Simulation::time() const { return impl_->time; }
const SimulationSetup& Simulation::setup() const { return impl_->setup; }
const LinkedOctree& Simulation::body() const { return impl_->body; }
const Hierarchy& Simulation::hierarchy() const { return impl_->hierarchy(); }
const Backend& Simulation::backend() const { return *impl_->backend; }
std::size_t Simulation::cells() const { return impl_->hierarchy().values.size(); }
std::size_t Simulation::cells_before_cuts() const { return impl_->cells_before; }
std::size_t Simulation::vertices() const { return impl_->finest().point.size(); }
std::size_t Simulation::hanging() const { return count_hanging(impl_->finest()); }
std::size_t Simulation::pieces() const { return impl_->structure->pieces(); }
std::size_t Simulation::links_cut() const { return impl_->links_cut; }
const std::vector<std::string>& Simulation::warnings() const { return impl_->warnings; }

std::size_t Simulation::unknowns() const {
  std::size_t count = 0;
  for (const std::uint8_t fixed : impl_->finest().fixed)
    for (int c = 0; c < 3; ++c) count += ((fixed >> c) & 1) == 0;
  return count;
}

std::size_t Simulation::bytes() const {
  return impl_->body.bytes() + impl_->structure->bytes() + impl_->backend->bytes() +
         impl_->solver->bytes() + (impl_->surface ? impl_->surface->bytes() : 0) +
         (impl_->positions.capacity() + impl_->normals.capacity()) * sizeof(Vec3d);
}

PhaseTimes Simulation::seconds() const {
  const PhaseClock& clock = impl_->clock;
  SolverTimes solver = impl_->solver->times();
  solver.structure += impl_->earlier.structure;
  solver.values += impl_->earlier.values;
  solver.solve += impl_->earlier.solve;
  return {{"voxelise", clock.voxelise},
          {"cut", clock.cut},
          {"structure", clock.structure + solver.structure},
          {"load", clock.load},
          {"values", solver.values},
          {"solve", solver.solve},
          {"forces", clock.step - solver.values - solver.solve},
          {"surface", clock.surface},
          {"surface_bind", clock.surface_bind},
          {"surface_positions", clock.surface_positions},
          {"surface_normals", clock.surface_normals}};
}

Snapshot Simulation::snapshot() const {
  Snapshot out =
      make_snapshot(impl_->body, impl_->hierarchy(), impl_->read_vector(impl_->state.displacement),
                    impl_->read_vector(impl_->state.velocity),
                    impl_->structure->external().on_all(impl_->hierarchy()));
  out.piece = impl_->structure->piece_of_cells();
  const Level& level = impl_->finest();
  std::vector<double> rotations(4 * impl_->hierarchy().values.size());
  impl_->backend->read_rotations(rotations);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const std::uint8_t index = impl_->hierarchy().values[c].material;
    const Material& material =
        index == 0 ? impl_->setup.material : impl_->setup.regions[index - std::size_t{1}].material;
    out.young.push_back(material.young);
    out.poisson.push_back(material.poisson);
    out.density.push_back(material.density);
    const double* q = rotations.data() + 4 * static_cast<std::size_t>(c);
    out.rotation.push_back(kernels::to_matrix(kernels::Quat<double>{q[0], q[1], q[2], q[3]}));
  }
  return out;
}

SurfaceMesh Simulation::surface_mesh() const {
  expects(!impl_->broken, "surface_mesh: not during a step, nor after one that threw");
  if (!impl_->surface) return {};
  return impl_->surface->mesh(impl_->positions, impl_->normals, impl_->structure->piece_of_cells());
}

std::uint64_t Simulation::state_hash() const {
  Hash hash;  // in vertex order
  for (const int x : {impl_->state.displacement, impl_->state.velocity})
    hash.add(impl_->read_vector(x));
  return hash.value();
}

Box3 Simulation::deformed_box() const {
  const std::vector<double> u = impl_->read_vector(impl_->state.displacement);
  Box3 box;
  for (std::size_t v = 0; v < impl_->finest().point.size(); ++v)
    box.add(impl_->body.lattice().point(impl_->finest().point[v]) +
            Vec3d{u[3 * v], u[3 * v + 1], u[3 * v + 2]});
  return box;
}

double Simulation::volume() const {
  const Level& level = impl_->finest();
  double finest = 0;
  for (const std::uint8_t log2 : level.size_log2) finest += static_cast<double>(1 << (3 * log2));
  const double h = impl_->hierarchy().spacing;
  return finest * h * h * h;
}

std::vector<Vec3d> Simulation::deformed_corners() const {
  return cell_corners(impl_->body.lattice(), impl_->finest(),
                      impl_->read_vector(impl_->state.displacement));
}

}  // namespace kerf
