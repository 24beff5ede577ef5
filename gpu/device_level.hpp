// SPDX-License-Identifier: MIT
//
// What a device backend keeps of one level beside its structure, and of the values of level 0.
#pragma once

#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/backend.hpp"
#include "core/levels/colours.hpp"
#include "gpu/device_structure.hpp"
#include "gpu/level_view.hpp"

namespace kerf::gpu {

/// A vector of one level, of the scalars S of the cycle or exact. Takes memory when it is first
/// used; before, it is zero.
template <class Device, class S>
struct DeviceVector {
  DeviceVector(Device& device, bool exact)
      : single(device), doubled(device), is_exact(exact || std::is_same_v<S, double>) {}

  /// body(data) with the type that it has.
  template <class Body>
  void with(const Body& body) const {
    if constexpr (!std::is_same_v<S, double>) {
      if (!is_exact) {
        body(single.data());
        return;
      }
    }
    body(doubled.data());
  }
  template <class T>
  T* in() const {
    if constexpr (std::is_same_v<T, double>)
      return doubled.data();
    else
      return single.data();
  }
  std::size_t size() const { return is_exact ? doubled.size() : single.size(); }
  void reset() {
    single.reset();
    doubled.reset();
  }
  void assign(std::size_t size) {
    if (is_exact)
      doubled.assign(size);
    else
      single.assign(size);
  }
  void reserve(std::size_t size) {
    if (is_exact)
      doubled.reserve(size);
    else
      single.reserve(size);
  }
  void resize(std::size_t size) {
    if (is_exact)
      doubled.resize(size);
    else
      single.resize(size);
  }

  DeviceArray<Device, S> single;
  DeviceArray<Device, double> doubled;
  bool is_exact;
};

template <class Device, class S>
struct DeviceLevel {
  explicit DeviceLevel(Device& device)
      : structure(device),
        matrices(device),
        plain(device),
        first(device),
        first_slots(device),
        inverse_diagonal(device),
        factors(device),
        colour_order(device) {}

  DeviceStructure<Device> structure;
  DeviceArray<Device, S> matrices;                ///< tiles of 300 scalars; empty on level 0
  DeviceArray<Device, std::uint8_t> plain;        ///< see MarkPlain; empty on level 0
  DeviceArray<Device, std::int32_t> first;        ///< of vertices, see FindFirst
  DeviceArray<Device, std::uint8_t> first_slots;  ///< of cells, see MarkFirst
  DeviceArray<Device, Sym3<S>> inverse_diagonal;
  DeviceArray<Device, S> factors;                ///< take and keep of each step of Chebyshev
  std::vector<DeviceVector<Device, S>> vectors;  ///< by VectorId
  double bound = 0;                              ///< of the spectrum of D^-1 A
  bool solution_is_zero = false;  ///< known: the first residual is f, no product needed
  Colours colours;                ///< once Gauss-Seidel asks for them
  DeviceArray<Device, std::int32_t> colour_order;

  LevelView view() const { return structure.view(); }
  std::int32_t cells() const { return structure.cells(); }
  std::int32_t vertices() const { return structure.vertices(); }
  std::int32_t scalars() const { return 3 * structure.vertices(); }
};

template <class T>
MaterialConstants<T> material_of(double poisson, kernels::MassModel model) {
  const auto K = kernels::unit_hex_stiffness(poisson);
  const auto modes = kernels::mode_constants(poisson, model);
  const auto& k = modes.stiffness;
  MaterialConstants<T> out{};
  for (int i = 0; i < kUnknowns; ++i)
    for (int j = 0; j < kUnknowns; ++j) out.stiffness.k[i][j] = static_cast<T>(K.k[i][j]);
  out.modes.stiffness = {static_cast<T>(k.a), static_cast<T>(k.b), static_cast<T>(k.c),
                         static_cast<T>(k.d), static_cast<T>(k.e), static_cast<T>(k.f),
                         static_cast<T>(k.g)};
  for (int i = 0; i < 4; ++i) out.modes.mass[i] = static_cast<T>(modes.mass[i]);
  return out;
}

/// The kinds of the cells of level 0 (CellValueList), of which a body has few.
template <class Device>
class ElementKinds {
 public:
  explicit ElementKinds(Device& device) : kinds_(device) {}

  void load(const CellValueList& values) {
    std::vector<std::uint16_t> kinds;
    kinds.reserve(values.size());
    for (std::size_t c = 0; c < values.size(); ++c) kinds.push_back(values.kind(c));
    kinds_.upload(kinds);
    known_ = values.kinds().size();
  }
  /// @returns whether there is a new kind. `cells`: those that changed.
  bool update(const CellValueList& values, const std::vector<std::int32_t>& cells, Device& device,
              Staging<Device>& staging) {
    kinds_.resize(values.size());
    std::vector<PlacedItem<std::uint16_t>> placed;
    for (const std::int32_t c : cells)
      placed.push_back({c, values.kind(static_cast<std::size_t>(c))});
    device.launch(count_of(placed), WriteItem<std::uint16_t>{staging.put(placed), kinds_.data()});
    return std::exchange(known_, values.kinds().size()) != values.kinds().size();
  }
  const std::uint16_t* data() const { return kinds_.data(); }

 private:
  std::size_t known_ = 0;
  DeviceArray<Device, std::uint16_t> kinds_;
};

/// The rotations of level 0; see RotationView.
template <class Device, class S>
class DeviceRotations {
 public:
  explicit DeviceRotations(Device& device) : exact_(device), rounded_(device), rest_(device) {}

  std::size_t size() const { return kMixed ? rounded_.size() : exact_.size(); }
  void assign(std::size_t cells) {
    each([&](auto& array) { array.assign(cells); });
  }
  void reserve(std::size_t cells) {
    each([&](auto& array) { array.reserve(cells); });
  }
  void resize(std::size_t cells) {
    each([&](auto& array) { array.resize(cells); });
  }
  RotationView view() const {
    return {kMixed ? nullptr : exact_.data(), rounded_.data(), rest_.data()};
  }
  std::vector<Quat<double>> read() const {
    std::vector<Quat<double>> out(size());
    if constexpr (kMixed) {
      std::vector<Quat<float>> rounded(size()), rest(size());
      rounded_.read(0, rounded);
      rest_.read(0, rest);
      const RotationView host{nullptr, rounded.data(), rest.data()};
      for (std::size_t c = 0; c < out.size(); ++c)
        out[c] = host.get<double>(static_cast<std::int32_t>(c));
    } else {
      exact_.read(0, out);
    }
    return out;
  }
  void write(const std::vector<Quat<double>>& in) {
    if constexpr (kMixed) {
      std::vector<Quat<float>> rounded(in.size()), rest(in.size());
      const RotationView host{nullptr, rounded.data(), rest.data()};
      for (std::size_t c = 0; c < in.size(); ++c) host.set(static_cast<std::int32_t>(c), in[c]);
      rounded_.write(0, rounded);
      rest_.write(0, rest);
    } else {
      exact_.write(0, in);
    }
  }

 private:
  static constexpr bool kMixed = !std::is_same_v<S, double>;

  template <class Change>
  void each(const Change& change) {
    if constexpr (kMixed) {
      change(rounded_);
      change(rest_);
    } else {
      change(exact_);
    }
  }

  DeviceArray<Device, Quat<double>> exact_;
  DeviceArray<Device, Quat<float>> rounded_, rest_;
};

/// Element values of level 0, in one precision.
template <class Device, class T>
struct FinestValues {
  explicit FinestValues(Device& device) : element(device), materials(device), mass(device) {}

  void load(const Hierarchy& hierarchy, const std::vector<CellValues>& kinds) {
    load_kinds(kinds);
    const bool lumped = hierarchy.lumped_mass;
    const auto model = lumped ? kernels::MassModel::lumped : kernels::MassModel::consistent;
    std::vector<MaterialConstants<T>> constants;
    for (const double poisson : hierarchy.poisson)
      constants.push_back(material_of<T>(poisson, model));
    materials.upload(constants);
    const auto M =
        lumped ? kernels::unit_hex_mass_lumped<double>() : kernels::unit_hex_mass<double>();
    std::vector<kernels::HexMass<T>> masses(1);
    for (int i = 0; i < kCorners; ++i)
      for (int j = 0; j < kCorners; ++j) masses[0].m[i][j] = static_cast<T>(M.m[i][j]);
    mass.upload(masses);
  }
  void load_kinds(const std::vector<CellValues>& kinds) {
    std::vector<Element<T>> elements;
    for (const CellValues& v : kinds)
      elements.push_back({static_cast<T>(v.stiffness), static_cast<T>(v.mass), v.material});
    element.upload(elements);
  }

  DeviceArray<Device, Element<T>> element;  ///< of kinds
  DeviceArray<Device, MaterialConstants<T>> materials;
  DeviceArray<Device, kernels::HexMass<T>> mass;
};

}  // namespace kerf::gpu
