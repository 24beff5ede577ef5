// SPDX-License-Identifier: MIT
//
// What a device backend keeps of one level beside its structure, and of the values of level 0.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "core/backend.hpp"
#include "core/levels/colours.hpp"
#include "gpu/device_structure.hpp"
#include "gpu/level_view.hpp"

namespace kerf::gpu {

/// A vector of one level, of the scalars S of the cycle or exact.
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
Element<T> element_of(const CellValues& values) {
  return {static_cast<T>(values.stiffness), static_cast<T>(values.mass), values.material};
}

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

/// Rotations and element values of level 0, in one precision.
template <class Device, class T>
struct FinestValues {
  explicit FinestValues(Device& device)
      : rotation(device), element(device), materials(device), mass(device) {}

  void load(const Hierarchy& hierarchy) {
    rotation.upload(std::vector<Quat<T>>(hierarchy.values.size()));
    std::vector<Element<T>> elements;
    for (std::size_t c = 0; c < hierarchy.values.size(); ++c)
      elements.push_back(element_of<T>(hierarchy.values[c]));
    element.upload(elements);
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

  /// Rotations are the caller's; there is room for them afterwards.
  void update(const Hierarchy& hierarchy, const LevelChange& change, Device& device,
              Staging<Device>& staging) {
    const auto cells = count_of(hierarchy.values);
    rotation.reserve(hierarchy.values.size());
    element.resize(hierarchy.values.size());
    std::vector<PlacedItem<Element<T>>> placed;
    for (const std::int32_t c : listed(change.cells, change.cells_before, cells))
      placed.push_back({c, element_of<T>(hierarchy.values[static_cast<std::size_t>(c)])});
    device.launch(count_of(placed), WriteItem<Element<T>>{staging.put(placed), element.data()});
  }

  DeviceArray<Device, Quat<T>> rotation;
  DeviceArray<Device, Element<T>> element;
  DeviceArray<Device, MaterialConstants<T>> materials;
  DeviceArray<Device, kernels::HexMass<T>> mass;
};

}  // namespace kerf::gpu
