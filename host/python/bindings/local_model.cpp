// Local models, one at a time, as the session makes and packs them.
#include <nanobind/stl/complex.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <complex>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "host/linearize/body_response.hpp"
#include "host/linearize/compliance_error.hpp"
#include "host/linearize/damping_error.hpp"
#include "host/linearize/growth_limit.hpp"
#include "host/linearize/model_builder.hpp"
#include "host/msd/vectors.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "host/python/bindings/scene.hpp"
#include "host/session/model_message.hpp"
#include "shared/servo_tick.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::python {
namespace {

// A model with the body and the state that it was made of, both its own: the body may go on.
struct BuiltModel {
  host::Body body;
  host::BodyState state;
  host::SurfacePoint at;
  host::LocalModel model;
  wire::PackedModel packed;
  std::unique_ptr<host::BodyResponse> response;  // made when it is asked for

  host::BodyResponse& full() {
    if (!response)
      response = std::make_unique<host::BodyResponse>(body, state, std::vector<host::SurfacePoint>{at});
    return *response;
  }
};

std::unique_ptr<BuiltModel> build_model(const MovingBody& moving, const nb::dict& scene,
                                        const Positions& position_m, const Positions& velocity_m_s,
                                        const Vector& at_m) {
  const host::BodyState state{to_columns(position_m, "position_m"), to_columns(velocity_m_s, "velocity_m_s")};
  if (state.position_m.cols() != moving.body().node_count() ||
      state.velocity_m_s.cols() != moving.body().node_count())
    throw std::invalid_argument("state: must have " + std::to_string(moving.body().node_count()) +
                                " rows, one per node");
  const nb::dict given = table(scene, "model");
  const host::BuilderConfig config = read_model(given);
  const auto valid_ticks = nb::cast<std::uint16_t>(given["valid_ticks"]);
  const host::FrictionSpec friction = read_friction(scene);
  const ContactLaw<double> law = read_contact(scene);
  const SurfaceKind surface = read_surface(scene);
  const Vec3d at = to_vector(at_m, "at");
  const nb::gil_scoped_release no_gil;
  auto built = std::make_unique<BuiltModel>(BuiltModel{moving.body(), state, {}, {}, {}, nullptr});
  built->at = host::nearest_surface_point(built->body, state.position_m, host::to_eigen(at));
  const auto builder = host::make_builder(built->body, config, kTick_s);
  built->model = builder->build(built->state, built->at, {});
  if (built->model.modes() == 0)
    throw std::invalid_argument("at: the nodes there are all fixed: no local model can be had");
  host::limit_growth(built->model, valid_ticks * kTick_s);
  wire::ModelContents contents;
  host::pack_model(built->model, {1, 0, valid_ticks, TipSource::counts, ModelKind::modes}, law, surface,
                   host::SurfaceFriction(built->body, friction), {}, contents);
  built->packed = wire::pack(contents);
  return built;
}

nb::object by_frequency(const std::vector<Eigen::Matrix3cd>& compliance) {
  auto owned = std::make_unique<std::vector<std::complex<double>>>();
  for (const Eigen::Matrix3cd& c : compliance)
    for (Eigen::Index row = 0; row < 3; ++row)
      for (Eigen::Index column = 0; column < 3; ++column) owned->push_back(c(row, column));
  std::complex<double>* data = owned->data();
  nb::capsule owner(owned.release(),
                    [](void* p) noexcept { delete static_cast<std::vector<std::complex<double>>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, std::complex<double>>(
      data, {compliance.size(), std::size_t{3}, std::size_t{3}}, owner));
}

double angular(double hertz) {
  if (!(hertz >= 0.0) || !std::isfinite(hertz))
    throw std::invalid_argument("frequency_Hz = " + std::to_string(hertz) + ": must be in [0, inf)");
  return 2.0 * std::numbers::pi * hertz;
}

nb::bytes state_bytes(const BuiltModel& built) {
  std::array<std::uint8_t, 2048> out{};
  std::size_t written = 0;
  if (wire::serialize(built.packed.state, out, written) != Status::ok)
    throw std::runtime_error("the state does not fit its message");
  return nb::bytes(out.data(), written);
}

}  // namespace

void bind_model(nb::module_& module) {
  using namespace nanobind::literals;
  nb::class_<BuiltModel>(module, "LocalModel")
      .def_prop_ro("modes", [](const BuiltModel& b) { return b.model.modes(); })
      .def_prop_ro("nodes",
                   [](const BuiltModel& b) {
                     return column<std::int32_t>(b.model.node, [](int node) { return node; });
                   })
      .def_prop_ro("surface_nodes", [](const BuiltModel& b) { return b.model.surface_nodes; })
      .def_prop_ro("springs", [](const BuiltModel& b) { return b.model.springs.size(); })
      .def_prop_ro(
          "at_m",
          [](const BuiltModel& b) {
            return vector3(host::from_eigen(host::surface_position_m(b.body, b.state.position_m, b.at)));
          })
      .def_prop_ro("lambda_rad2_s2",
                   [](const BuiltModel& b) {
                     const Eigen::VectorXd& v = b.model.lambda_rad2_s2;
                     return array(std::vector<double>(v.begin(), v.end()));
                   })
      .def_prop_ro("damping_rad_s",
                   [](const BuiltModel& b) {
                     const Eigen::VectorXd& v = b.model.damping_rad_s;
                     return array(std::vector<double>(v.begin(), v.end()));
                   })
      .def_prop_ro("damping_coupling", [](const BuiltModel& b) { return b.model.damping_coupling; })
      .def_prop_ro("limited_modes", [](const BuiltModel& b) { return b.model.limited_modes; })
      .def_prop_ro(
          "packed_basis",
          [](const BuiltModel& b) { return nb::bytes(b.packed.basis->data(), b.packed.basis->size()); })
      .def_prop_ro("packed_state", &state_bytes)
      .def(
          "compliance_m_N",
          [](const BuiltModel& b, const Times& frequency_Hz) {
            std::vector<Eigen::Matrix3cd> values;
            values.reserve(frequency_Hz.shape(0));
            for (std::size_t i = 0; i < frequency_Hz.shape(0); ++i)
              values.push_back(host::compliance(b.model, b.at, angular(frequency_Hz.data()[i])));
            return by_frequency(values);
          },
          "frequency_Hz"_a)
      .def(
          "body_compliance_m_N",
          [](BuiltModel& b, const Times& frequency_Hz) {
            std::vector<Eigen::Matrix3cd> values;
            {
              const nb::gil_scoped_release no_gil;
              for (std::size_t i = 0; i < frequency_Hz.shape(0); ++i)
                values.push_back(b.full().compliance(angular(frequency_Hz.data()[i])).front());
            }
            return by_frequency(values);
          },
          "frequency_Hz"_a)
      .def(
          "damping_bound",
          [](const BuiltModel& b, const Times& frequency_Hz) {
            const Eigen::Matrix3Xd phi = host::modes_at(b.model, b.at);
            const double eta = host::damping_coupling_norm(b.model.damping_1_s);
            std::vector<double> bound;
            for (std::size_t i = 0; i < frequency_Hz.shape(0); ++i) {
              const double w = angular(frequency_Hz.data()[i]);
              bound.push_back(
                  w > 0 ? host::damping_error_bound(phi, b.model.lambda_rad2_s2, b.model.damping_1_s, eta, w)
                        : 0.0);
            }
            return array(std::move(bound));
          },
          "frequency_Hz"_a);
  module.def("build_model", &build_model, "body"_a, "scene"_a, "position_m"_a, "velocity_m_s"_a, "at_m"_a);
}

}  // namespace palpate::python
