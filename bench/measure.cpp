// SPDX-License-Identifier: MIT
#include "bench/measure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "bench/memory_peak.hpp"
#include "bench/phases.hpp"
#include "core/base/error.hpp"
#include "core/base/memory.hpp"
#include "core/base/timer.hpp"

namespace kerf::bench {
namespace {

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double least(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end());
}

std::string hex(std::uint64_t hash) {
  char out[17];
  std::snprintf(out, sizeof out, "%016llx", static_cast<unsigned long long>(hash));
  return out;
}

std::uint64_t hash_of(const Outcome& outcome) {
  return outcome.values.empty() ? outcome.hash : bench::hash_of(outcome.values);
}

double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return a.size() == b.size() && size > 0 ? std::sqrt(difference / size) : kNone;
}

const char* precision_key(Precision precision) {
  return precision == Precision::mixed ? "mixed" : "double";
}

Precision precision_of(const std::string& key) {
  return key == "mixed" ? Precision::mixed : Precision::double_;
}

/// A machine and what it was made from.
struct Seat {
  std::string backend;
  int threads;
  Precision precision;
  std::unique_ptr<Machine> machine;
};

/// One variant in one phase.
struct Entrant {
  Trial* trial = nullptr;
  const Seat* seat = nullptr;
  bool warm = false, gave_up = false;
  std::vector<double> seconds;
  double spent = 0;
  double peak = 0;
  std::uint64_t hash = 0;
  double residual = kNone;
  DeviceWork work;  // of the last run
};

class SceneRun {
 public:
  SceneRun(const std::string& scene, const Options& options, const Ceilings& ceilings,
           const Listener& listener)
      : scene_(scene), options_(options), ceilings_(ceilings), listener_(listener) {}

  std::vector<Row> run() {
    std::string missing;
    listener_.progress(scene_ + ": building");
    release_free_memory();
    auto setup = make_scene(scene_, options_.size, mesh_folders(options_.meshes), missing);
    if (!setup) {
      listener_.note(text("skipped ", scene_, ": there is no ", missing,
                          "; name its folder by --meshes or KERF_MESHES"));
      return {};
    }
    body_ = std::make_unique<Body>(std::move(*setup));
    list_seats();
    if (!memory_suffices()) return {};
    body_->build();
    open_seats();
    for (const Phase& phase : phases())
      if (wanted(phase) && has_levels(phase)) measure(phase);
    return std::move(rows_);
  }

 private:
  void list_seats();
  bool memory_suffices() const;
  void open_seats();
  bool wanted(const Phase& phase) const;
  bool has_levels(const Phase& phase) const;
  void measure(const Phase& phase);
  std::vector<Entrant> entrants_of(const Phase& phase);
  void run_once(const Phase& phase, Entrant& entrant);
  void look_at(const Phase& phase, Entrant& entrant);
  bool enough(const Entrant& entrant) const;
  void add_row(const Phase& phase, const Entrant& entrant);

  const std::string& scene_;
  const Options& options_;
  const Ceilings& ceilings_;
  const Listener& listener_;
  std::unique_ptr<Body> body_;
  std::vector<Seat> seats_;
  std::vector<double> exact_;
  std::vector<std::unique_ptr<Trial>> trials_;
  std::vector<const Seat*> seat_of_;  // of each trial
  std::vector<double> reference_;     // result of the CPU backend in double, this phase
  std::vector<Row> rows_;
};

// Each backend, number of threads and precision once, however many candidates it serves.
void SceneRun::list_seats() {
  for (const Candidate& candidate : candidates()) {
    const auto& names = options_.backends;
    if (std::find(names.begin(), names.end(), candidate.name) == names.end()) continue;
    for (const int threads : options_.threads)
      for (const std::string& key : options_.precisions) {
        const Precision precision = precision_of(key);
        const auto same = [&](const Seat& s) {
          return s.backend == candidate.backend && s.threads == threads && s.precision == precision;
        };
        if (std::none_of(seats_.begin(), seats_.end(), same))
          seats_.push_back({candidate.backend, threads, precision, nullptr});
      }
  }
}

// Measured on the CPU backend in double: 1500 bytes a cell for a body and one backend at an
// operator, 1900 at a solve, 2200 at a cut, which holds a second structure for a while. The
// values of a GPU are in its own memory: of a uniform body (128^3, mixed) the process held 700 with
// those of a CPU backend, which are some 400.
bool SceneRun::memory_suffices() const {
  constexpr double kShared = 1100, kSecondStructure = 900, kValues = 1600;
  bool reloads = false;
  for (const Phase& phase : phases()) reloads = reloads || (phase.reloads && wanted(phase));
  const auto seats = static_cast<double>(std::count_if(
      seats_.begin(), seats_.end(), [](const Seat& s) { return s.backend.rfind("cuda", 0) != 0; }));
  constexpr double kSharedByGpus = 600;
  const bool by_gpus = seats == 0 && body_->setup().body.refinement == 0;
  const double bytes =
      static_cast<double>(body_->cells()) *
      ((by_gpus ? kSharedByGpus : kShared) + (reloads ? kSecondStructure : 0) + kValues * seats);
  const double available = physical_memory();
  if (bytes < 0.9 * available) return true;
  listener_.note(text("skipped ", scene_, ": its ", body_->cells(), " cells with ", seats_.size(),
                      seats_.size() == 1 ? " backend" : " backends at once", " need about ",
                      std::ceil(bytes / 1e8) / 10, " GB; this machine has ",
                      std::floor(available / 1e8) / 10, " GB",
                      seats_.size() == 1 ? "" : ". Name one number of threads at a time"));
  return false;
}

void SceneRun::open_seats() {
  for (Seat& seat : seats_) {
    SolverSetup setup;
    setup.backend = seat.backend;
    setup.threads = seat.threads;
    setup.precision = seat.precision;
    listener_.progress(text(scene_, ": loading ", seat.backend, ", threads ", seat.threads));
    try {
      seat.machine = std::make_unique<Machine>(*body_, setup);
      seat.machine->load();
    } catch (const Error& error) {
      // `all` takes what there is.
      const bool optional = (options_.all_backends && seat.backend != "cpu") ||
                            (options_.all_precisions && seat.precision != Precision::double_);
      if (!optional) throw;
      seat.machine.reset();
      listener_.note(text("left out ", seat.backend, " in ", precision_key(seat.precision), ": ",
                          error.what()));
    }
  }
  for (const Candidate& candidate : candidates()) {
    const auto& names = options_.backends;
    if (std::find(names.begin(), names.end(), candidate.name) == names.end()) continue;
    for (const Seat& seat : seats_)
      if (seat.machine && seat.backend == candidate.backend) {
        trials_.push_back(std::make_unique<Trial>(*body_, *seat.machine, candidate, exact_));
        trials_.back()->give_up = options_.give_up;
        seat_of_.push_back(&seat);
      }
  }
}

bool SceneRun::wanted(const Phase& phase) const {
  const auto& names = options_.phases;
  if (std::find(names.begin(), names.end(), phase.name) == names.end()) return false;
  for (const SceneInfo& info : scenes())
    if (scene_ == info.name && info.solve_only && std::string(phase.name) != "solve") return false;
  return true;
}

bool SceneRun::has_levels(const Phase& phase) const {
  if (phase.levels <= static_cast<int>(body_->hierarchy().levels.size())) return true;
  listener_.note(text("skipped ", phase.name, " of ", scene_, ": the body has one level only"));
  return false;
}

std::vector<Entrant> SceneRun::entrants_of(const Phase& phase) {
  std::vector<Entrant> out;
  for (std::size_t i = 0; i < trials_.size(); ++i) {
    const Candidate& candidate = trials_[i]->candidate;
    if (!candidate.phases.empty() && !candidate.phases.contains(phase.name)) continue;
    // The fast CPU backend has no Gauss-Seidel.
    if (phase.name == std::string_view("smooth-gauss-seidel") &&
        trials_[i]->backend().name() == std::string_view("cpu"))
      continue;
    const std::int32_t vertices = body_->finest().vertices();
    if (candidate.most_vertices > 0 && vertices > candidate.most_vertices) {
      listener_.note(text("skipped ", phase.name, " of ", scene_, " by ", candidate.name, ": ",
                          vertices, " vertices; beyond ", candidate.most_vertices,
                          " it takes too long"));
      continue;
    }
    Entrant entrant;
    entrant.trial = trials_[i].get();
    entrant.seat = seat_of_[i];
    out.push_back(std::move(entrant));
  }
  return out;
}

void SceneRun::measure(const Phase& phase) {
  std::vector<Entrant> entrants = entrants_of(phase);
  reference_.clear();
  for (bool more = true; more;) {
    more = false;
    for (Entrant& entrant : entrants) {
      if (enough(entrant)) continue;
      more = true;
      listener_.progress(text(scene_, ": ", phase.name, ", ", entrant.trial->candidate.name,
                              ", threads ", entrant.seat->threads, ", run ",
                              entrant.seconds.size() + 1));
      run_once(phase, entrant);
    }
  }
  for (const Entrant& entrant : entrants)
    if (!entrant.gave_up) add_row(phase, entrant);
  for (Entrant& entrant : entrants) entrant.trial->drop();
  release_free_memory();
  if (!phase.reloads) return;
  for (Entrant& entrant : entrants) {
    entrant.trial->machine.load();
    entrant.trial->hierarchy.reset();
    entrant.trial->previous.reset();
    entrant.trial->structure.reset();
    entrant.trial->structure_before.reset();
  }
}

// The first run warms up; where one run already takes all the time there is, it counts.
void SceneRun::run_once(const Phase& phase, Entrant& entrant) {
  Trial& trial = *entrant.trial;
  phase.prepare(trial);
  trial.backend().wait();
  reset_memory_peak();
  const DeviceWork before = trial.backend().device_work();
  const Timer timer;
  try {
    phase.run(trial);
    trial.backend().wait();
  } catch (const GaveUp&) {
    entrant.gave_up = true;
    listener_.note(text("gave up ", phase.name, " of ", scene_, " by ", trial.candidate.name,
                        ", threads ", entrant.seat->threads, ", after ", options_.give_up, " s"));
    return;
  }
  const double seconds = timer.seconds();
  const DeviceWork after = trial.backend().device_work();
  entrant.work = {after.calls - before.calls, after.launches - before.launches,
                  after.bytes_up - before.bytes_up, after.bytes_down - before.bytes_down};
  double others = 0;
  for (const Seat& seat : seats_)
    if (seat.machine && &seat != entrant.seat)
      others += static_cast<double>(seat.machine->backend().bytes());
  entrant.peak = std::max(entrant.peak, memory_peak() - others);
  entrant.spent += seconds;
  const bool first = !entrant.warm;
  entrant.warm = true;
  if (!first || (options_.seconds > 0 && entrant.spent > options_.seconds))
    entrant.seconds.push_back(seconds);
  if (first || enough(entrant)) look_at(phase, entrant);
}

// Results of the first and of the last run must agree.
void SceneRun::look_at(const Phase& phase, Entrant& entrant) {
  const Outcome outcome = phase.outcome(*entrant.trial);
  const std::uint64_t hash = hash_of(outcome);
  if (entrant.hash != 0 && entrant.hash != hash)
    listener_.note(text(scene_, ", ", phase.name, ", ", entrant.trial->candidate.name,
                        ": two runs gave two results"));
  entrant.hash = hash;
  entrant.residual = outcome.residual;
  if (!std::isnan(outcome.residual) || outcome.values.empty()) return;
  const bool is_reference =
      entrant.trial->candidate.name == "cpu" && entrant.seat->precision == Precision::double_;
  if (is_reference && reference_.empty()) reference_ = outcome.values;
  entrant.residual = relative_difference(outcome.values, reference_);
}

bool SceneRun::enough(const Entrant& entrant) const {
  if (entrant.gave_up) return true;
  if (!entrant.warm) return false;
  const std::size_t runs = entrant.seconds.size();
  if (options_.seconds > 0 && runs > 0 && entrant.spent > options_.seconds) return true;
  // Short runs are worth more of them: they cost nothing, and their minimum settles slowly.
  constexpr double kShort = 0.1;  // s
  constexpr std::size_t kMost = 100;
  const auto asked = static_cast<std::size_t>(options_.repeat);
  return runs >= asked && (options_.size == Size::small || entrant.spent > kShort || runs >= kMost);
}

void SceneRun::add_row(const Phase& phase, const Entrant& entrant) {
  const Trial& trial = *entrant.trial;
  const Seat& seat = *entrant.seat;
  const double seconds = least(entrant.seconds);
  Row row;
  row.scene = scene_;
  row.backend = trial.candidate.name;
  row.threads = trial.machine.backend().threads();
  row.precision = precision_key(seat.precision);
  row.cells = static_cast<double>(body_->cells());
  row.vertices = body_->finest().vertices();
  row.levels = trial.machine.levels();
  row.phase = phase.name;
  row.ms_min = 1e3 * seconds;
  row.ms_median = 1e3 * median(entrant.seconds);
  row.ns_per_cell = 1e9 * seconds / row.cells;
  row.residual = entrant.residual;
  row.state_hash = hex(entrant.hash);
  row.peak_bytes = entrant.peak;
  if (seat.backend == "cuda") {
    row.launches = static_cast<double>(entrant.work.launches);
    row.bytes_copied = static_cast<double>(entrant.work.bytes_up + entrant.work.bytes_down);
  }
  const Work work = phase.work(trial);
  if (work.slots > 0) {
    const double bytes =
        seat.precision == Precision::double_ ? work.bytes_double : work.bytes_single;
    row.gb_per_s = 1e-9 * bytes * row.cells / seconds;
    const bool in_single = seat.precision != Precision::double_;
    const std::string machine = seat.backend == "cuda" ? "cuda" : "machine";
    row.of_ceiling =
        row.cells / seconds *
        std::max(bytes / ceilings_.bytes_per_second(row.threads, machine),
                 work.slots / ceilings_.slots_per_second(row.threads, in_single, machine));
  }
  if (static_cast<int>(entrant.seconds.size()) < options_.repeat)
    listener_.note(text(scene_, ", ", phase.name, ", ", row.backend, ", threads ", row.threads,
                        ": ", entrant.seconds.size(), " of ", options_.repeat,
                        " runs, for they are long"));
  rows_.push_back(row);
  listener_.row(row);
}

}  // namespace

std::vector<Row> measure_scene(const std::string& scene, const Options& options,
                               const Ceilings& ceilings, const Listener& listener) {
  return SceneRun(scene, options, ceilings, listener).run();
}

std::vector<Row> ceiling_rows(const Ceilings& ceilings) {
  std::vector<Row> out;
  std::vector<Ceiling> all = ceilings.all();
  all.insert(all.end(), ceilings.gpu().begin(), ceilings.gpu().end());
  for (const Ceiling& ceiling : all) {
    const double seconds = least(ceiling.seconds);
    Row row;
    row.scene = "machine";
    row.backend = ceiling.machine;
    row.threads = ceiling.threads;
    row.precision = ceiling.precision;
    row.cells = ceiling.items;
    row.phase = ceiling.name;
    row.ms_min = 1e3 * seconds;
    row.ms_median = 1e3 * median(ceiling.seconds);
    row.ns_per_cell = 1e9 * seconds / ceiling.items;
    row.gb_per_s = ceiling.best();
    out.push_back(row);
  }
  return out;
}

}  // namespace kerf::bench
