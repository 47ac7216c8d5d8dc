// The simulated device in a hand, and the medium between board and host.
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>

#include <array>
#include <memory>
#include <span>
#include <string>

#include "host/link/uart.hpp"
#include "host/plant/plant.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/loop_datasets.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "host/python/bindings/scene.hpp"

namespace palpate::python {

void bind_device(nb::module_& module) {
  using namespace nanobind::literals;
  using plant::Plant;
  nb::class_<Plant>(module, "Plant")
      .def(
          "__init__",
          [](Plant* self, const nb::dict& scene) { new (self) Plant(read_plant(scene), read_path(scene)); },
          "scene"_a)
      .def(
          "advance",
          [](Plant& p, const std::array<float, 3>& setpoint_A, bool enabled, double duration_s) {
            p.advance(setpoint_A, enabled, duration_s);
          },
          "setpoint_A"_a, "enabled"_a, "duration_s"_a)
      .def("set_grip", &Plant::set_grip, "grip"_a)
      .def(
          "guide",
          [](Plant& p, const std::array<double, 3>& target_m) {
            p.guide({.position_m = {target_m[0], target_m[1], target_m[2]}, .velocity_m_s = {}});
          },
          "target_m"_a)
      .def_prop_ro("time_s", &Plant::time_s)
      .def_prop_ro("grip", &Plant::grip)
      .def_prop_ro("encoder_counts",
                   [](const Plant& p) {
                     const auto counts = p.encoder_counts();
                     return array(std::vector<std::int32_t>(counts.begin(), counts.end()));
                   })
      .def_prop_ro("measured_current_A",
                   [](const Plant& p) {
                     const auto current_A = p.measured_current_A();
                     return array(std::vector<float>(current_A.begin(), current_A.end()));
                   })
      .def_prop_ro("joint_rad", [](const Plant& p) { return vector3(p.joint_rad()); })
      .def_prop_ro("joint_rad_s", [](const Plant& p) { return vector3(p.joint_rad_s()); })
      .def_prop_ro("tip_m", [](const Plant& p) { return vector3(p.tip_position_m()); })
      .def_prop_ro("tip_velocity_m_s", [](const Plant& p) { return vector3(p.tip_velocity_m_s()); })
      .def_prop_ro("intended_m", [](const Plant& p) { return vector3(p.intended_position_m()); })
      .def_prop_ro("hand_force_N", [](const Plant& p) { return vector3(p.hand_force_N()); });

  using link::Uart;
  nb::class_<Uart>(module, "Uart")
      .def(nb::init<std::uint32_t, std::size_t>(), "baud"_a, "queue_bytes"_a)
      .def(
          "submit",
          [](Uart& u, const nb::bytes& data, std::uint32_t tick) {
            const auto* begin = static_cast<const std::uint8_t*>(data.data());
            return u.submit({begin, data.size()}, tick);
          },
          "data"_a, "tick"_a)
      .def(
          "deliver",
          [](Uart& u, std::uint32_t tick) {
            const std::vector<std::uint8_t> arrived = u.deliver(tick);
            return nb::bytes(arrived.data(), arrived.size());
          },
          "tick"_a)
      .def("backlog_bytes", &Uart::backlog_bytes, "tick"_a)
      .def_prop_ro("bytes_per_tick", &Uart::bytes_per_tick)
      .def_prop_ro("counters", [](const Uart& u) { return medium_counters(u.counters()); });
}

}  // namespace palpate::python
