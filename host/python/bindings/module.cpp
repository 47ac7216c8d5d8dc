#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include "firmware/core/renderer.hpp"
#include "host/link/known_boards.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "shared/model/local_model.hpp"
#include "shared/wire/messages.hpp"

NB_MODULE(_core, module) {
  using namespace nanobind::literals;
  module.doc() = "The C++ core of palpate; see _core.pyi.";
  module.attr("SCHEMA_HASH") = palpate::wire::kSchemaHash;
  nanobind::list known_boards;
  for (const std::string_view name : palpate::link::known_boards())
    known_boards.append(nanobind::str(name.data(), name.size()));
  module.attr("KNOWN_BOARDS") = nanobind::tuple(known_boards);
  module.attr("MAX_MODES") = palpate::kMaxModes;
  module.attr("MAX_HYBRID_MODES") = palpate::kMaxBasis / (3 * palpate::kMaxSurfaceNodes);
  module.attr("RENDERER_BYTES") = sizeof(palpate::firmware::Renderer);
  module.def("run_closed_loop", &palpate::python::run_closed_loop, "scene"_a, "actuator_fd"_a, "sensor_fd"_a,
             "progress"_a, "cache_folder"_a);
  module.def("linear_body", &palpate::python::linear_body, "scene"_a);
  module.def("compliance_errors", &palpate::python::compliance_errors, "scene"_a, "node"_a, "models"_a,
             "press_m"_a, "progress"_a);
  module.def("model_cost", &palpate::python::model_cost, "scene"_a, "rounds"_a);
  module.def("medium_limit", &palpate::python::medium_limit, "scene"_a, "ticks"_a);
  module.def("host_link_cost", &palpate::python::host_link_cost, "scene"_a, "rounds"_a);
  module.def("board_link_cost", &palpate::python::board_link_cost, "scene"_a, "actuator_fd"_a, "sensor_fd"_a,
             "rounds"_a);
  module.def("stiffest_wall_N_m", &palpate::python::stiffest_wall_N_m, "device"_a, "rate_Hz"_a,
             "delay_ticks"_a, "count_m"_a, "is_controlled"_a, "damping_N_s_m"_a, "duration_s"_a, "most_J"_a);
  module.def("simulate", &palpate::python::simulate, "scene"_a, "progress"_a);
  module.def("reference", &palpate::python::reference, "scene"_a, "time_s"_a, "tip_m"_a, "progress"_a);
  palpate::python::bind_body(module);
  palpate::python::bind_model(module);
  palpate::python::bind_session(module);
  palpate::python::bind_arm(module);
  palpate::python::bind_device(module);
  palpate::python::bind_endpoint(module);
  palpate::python::bind_live_loop(module);
  palpate::python::bind_virtual_device(module);
}
