// The arm as the firmware knows it (shared/device): where its tip is, and the numbers of its joints.
#include <nanobind/stl/array.h>

#include <array>
#include <stdexcept>
#include <vector>

#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "shared/device/arm.hpp"

namespace palpate::python {
namespace {

device::Pose pose_of(const std::array<float, 3>& joint_rad) {
  const device::Pose pose =
      device::evaluate(device::kPremium15, Vec3f{joint_rad[0], joint_rad[1], joint_rad[2]});
  if ((pose.faults & device::kInvalidAngle) != 0)
    throw std::invalid_argument("joint_rad: must be three finite angles");
  return pose;
}

std::vector<double> joints(float (*get)(const device::Joint&)) {
  std::vector<double> values;
  values.reserve(device::kPremium15.joint.size());
  for (const device::Joint& joint : device::kPremium15.joint)
    values.push_back(static_cast<double>(get(joint)));
  return values;
}

}  // namespace

void bind_arm(nb::module_& module) {
  using namespace nanobind::literals;
  module.def(
      "arm_tip_m",
      [](const std::array<float, 3>& joint_rad) {
        const Vec3f tip_m = pose_of(joint_rad).tip_m;
        return vector3(
            {static_cast<double>(tip_m.x), static_cast<double>(tip_m.y), static_cast<double>(tip_m.z)});
      },
      "joint_rad"_a);
  module.def(
      "arm_jacobian_m",
      [](const std::array<float, 3>& joint_rad) {
        const Mat3f jacobian_m = pose_of(joint_rad).jacobian_m;
        std::vector<double> rows;
        for (std::size_t row = 0; row < 3; ++row)
          for (std::size_t joint = 0; joint < 3; ++joint)
            rows.push_back(static_cast<double>(jacobian_m(row, joint)));
        return array(std::move(rows), 3);
      },
      "joint_rad"_a);
  module.def("arm_counts_rad",
             [] { return array(joints([](const device::Joint& joint) { return joint.counts_per_rad; })); });
  module.def("arm_torque_N_m_A", [] {
    return array(joints([](const device::Joint& joint) {
      return joint.transmission_ratio * device::kPremium15.torque_constant_N_m_A;
    }));
  });
}

}  // namespace palpate::python
