// A device without hardware at a link of the operating system.
#include "host/session/virtual_device.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <memory>
#include <string>
#include <vector>

#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "host/python/bindings/scene.hpp"

namespace palpate::python {

void bind_virtual_device(nb::module_& module) {
  using namespace nanobind::literals;
  using host::VirtualDevice;
  nb::class_<VirtualDevice>(module, "VirtualDevice")
      .def(nb::new_([](const nb::dict& scene, int actuator_fd, int sensor_fd, const std::string& link) {
             return std::make_unique<VirtualDevice>(
                 read_plant(scene), read_path(scene),
                 std::make_unique<host::FileDescriptorPeer>(actuator_fd, sensor_fd),
                 link::open_transport(link));
           }),
           "scene"_a, "actuator_fd"_a, "sensor_fd"_a, "link"_a)
      .def("start", &VirtualDevice::start)
      .def("stop", &VirtualDevice::stop, nb::call_guard<nb::gil_scoped_release>())
      .def(
          "guide_hand",
          [](VirtualDevice& device, double x_m, double y_m, double z_m) {
            return device.guide_hand({x_m, y_m, z_m});
          },
          "x_m"_a, "y_m"_a, "z_m"_a)
      .def("play_path", &VirtualDevice::play_path)
      .def("set_emergency_stop", &VirtualDevice::set_emergency_stop, "is_open"_a)
      .def_prop_ro("address", &VirtualDevice::address)
      .def_prop_ro("state", [](const VirtualDevice& device) {
        const host::VirtualDeviceState now = device.state();
        nb::dict result;
        result["tick"] = now.tick;
        result["tip_m"] = vector3(now.tip_m);
        result["hand_force_N"] = vector3(now.hand_force_N);
        result["force_N"] = array(std::vector<float>(now.force_N.begin(), now.force_N.end()));
        result["mode"] = now.mode;
        result["faults"] = now.faults;
        result["outputs_on"] = now.outputs_on;
        result["slipped_s"] = now.slipped_s;
        result["bytes_sent"] = now.link.bytes_sent;
        result["bytes_received"] = now.link.bytes_received;
        result["frames_unsent"] = now.link.frames_unsent;
        result["running"] = now.running;
        result["error"] = now.error;
        return result;
      });
}

}  // namespace palpate::python
