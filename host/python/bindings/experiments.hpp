// The experiments and the linear system of palpate._core (palpate/_core.pyi has their contracts).
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <optional>
#include <string>

namespace palpate::python {

namespace nb = nanobind;

using Times = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Positions = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

nb::dict run_closed_loop(const nb::dict& scene, int actuator_fd, int sensor_fd, const nb::callable& progress,
                         const std::string& cache_folder);
nb::dict linear_body(const nb::dict& scene);
nb::dict compliance_errors(const nb::dict& scene, int node, const nb::list& models, double press_m,
                           const nb::callable& progress);
// host/bench/link_cost.hpp
nb::dict medium_limit(const nb::dict& scene, std::uint32_t ticks);
nb::list host_link_cost(const nb::dict& scene, std::uint32_t rounds);
nb::list board_link_cost(const nb::dict& scene, int actuator_fd, int sensor_fd, std::uint32_t rounds);
nb::dict model_cost(const nb::dict& scene, std::uint32_t rounds);
// host/bench/virtual_wall.hpp
std::optional<double> stiffest_wall_N_m(const nb::dict& device, double rate_Hz, std::uint32_t delay_ticks,
                                        double count_m, bool is_controlled, double damping_N_s_m,
                                        double duration_s, double most_J);
nb::dict simulate(const nb::dict& scene, const nb::callable& progress);
nb::dict reference(const nb::dict& scene, const Times& time_s, const Positions& tip_m,
                   const nb::callable& progress);

}  // namespace palpate::python
