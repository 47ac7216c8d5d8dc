// Scene dictionaries (palpate.scene.Scene.to_dict) as the core's own configuration.
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "host/link/metered_link.hpp"
#include "host/msd/lattice.hpp"
#include "host/plant/plant.hpp"
#include "host/session/closed_loop.hpp"
#include "host/session/simulation.hpp"

namespace palpate::python {

namespace nb = nanobind;

// All throw std::invalid_argument for what the core refuses, with the key where it is known; a missing key is
// a KeyError, a bug of the caller.
host::Body read_body(const nb::dict& scene);
// At rest but for the scene's initial displacements.
host::BodyState read_start(const nb::dict& scene, const host::Body& body);
std::vector<host::NodeDrive> read_drives(const nb::dict& scene, const host::Body& body);
std::optional<int> read_probe_node(const nb::dict& scene, const host::Body& body);
ContactLaw<double> read_contact(const nb::dict& scene);
SurfaceKind read_surface(const nb::dict& scene);
host::FrictionSpec read_friction(const nb::dict& scene);
plant::TipPath read_path(const nb::dict& scene);
plant::PlantParameters read_plant(const nb::dict& scene);
// Of the table [model] what its builder needs.
host::BuilderConfig read_model(const nb::dict& model);
// cache_folder: for bases (model.basis_cache_MB).
host::ClosedLoopConfig read_closed_loop(const nb::dict& scene, const host::Body& body,
                                        const std::string& cache_folder);
// Of the table [link].
link::MeteredLinkOptions read_link(const nb::dict& scene);
host::Method read_method(const nb::dict& scene);

nb::dict table(const nb::dict& scene, const char* name);
double number(const nb::dict& table, const char* key);
std::uint32_t whole(const nb::dict& table, const char* key);
std::vector<std::uint32_t> whole_list(const nb::dict& table, const char* key);

}  // namespace palpate::python
