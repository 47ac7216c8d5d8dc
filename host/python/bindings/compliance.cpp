#include <nanobind/stl/vector.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "host/linearize/body_response.hpp"
#include "host/linearize/compliance_error.hpp"
#include "host/linearize/model_builder.hpp"
#include "host/linearize/pressed_state.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/progress.hpp"
#include "host/python/bindings/scene.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

// The node, and the middle of a triangle at it.
struct Places {
  host::SurfacePoint node, between;
  Eigen::Vector3d inward = Eigen::Vector3d::Zero();
};

Places places_at(const host::Body& body, int node) {
  const Eigen::Matrix3Xd& rest_m = body.rest_position_m();
  if (node < 0 || node >= body.node_count() || body.triangles().empty())
    throw std::invalid_argument("node: must be one of a body with a surface");
  const host::SurfacePoint nearest = host::nearest_surface_point(body, rest_m, rest_m.col(node));
  const host::Triangle& corners = body.triangles()[static_cast<std::size_t>(nearest.triangle)];
  const auto found = std::find(corners.begin(), corners.end(), node);
  if (found == corners.end()) throw std::invalid_argument("node: must lie on the surface");
  const Eigen::Vector3d along = rest_m.col(corners[1]) - rest_m.col(corners[0]);
  const Eigen::Vector3d across = rest_m.col(corners[2]) - rest_m.col(corners[0]);
  return {{nearest.triangle, Eigen::Vector3d::Unit(found - corners.begin())},
          {nearest.triangle, Eigen::Vector3d::Constant(1.0 / 3.0)},
          -along.cross(across).normalized()};
}

struct Compared {
  host::LocalModel model;  // at the node
  host::ComplianceError at_node, between;
};

struct Body {
  std::vector<double> frequency_Hz;
  std::vector<Eigen::Matrix3cd> at_node, between;
};

}  // namespace

nb::dict compliance_errors(const nb::dict& scene, int node, const nb::list& models, double press_m,
                           const nb::callable& progress) {
  const host::Body body = read_body(scene);
  const double step_s = kTick_s / whole(table(scene, "integrator"), "steps_per_tick");
  std::vector<host::BuilderConfig> configs;
  for (const nb::handle model : models) configs.push_back(read_model(nb::cast<nb::dict>(model)));
  const host::Progress report = with_gil(progress);

  Body full;
  std::vector<Compared> compared;
  {
    const nb::gil_scoped_release no_gil;
    const Places place = places_at(body, node);
    const host::BodyState state = host::pressed_state(body, node, press_m * place.inward, step_s);
    host::BodyResponse response(body, state, {place.node, place.between});
    full.frequency_Hz = host::compliance_grid_Hz();
    const auto total = static_cast<std::uint32_t>(full.frequency_Hz.size());
    for (const double hertz : full.frequency_Hz) {
      if (!report(static_cast<std::uint32_t>(full.at_node.size()), total))
        throw std::runtime_error("stopped");
      const auto exact = response.compliance(2.0 * std::numbers::pi * hertz);
      full.at_node.push_back(exact[0]);
      full.between.push_back(exact[1]);
    }
    for (const host::BuilderConfig& config : configs) {
      const auto builder = host::make_builder(body, config, kTick_s);
      Compared one{builder->build(state, place.node, {}), {}, {}};
      one.at_node = host::compliance_error(one.model, place.node, full.frequency_Hz, full.at_node);
      one.between = host::compliance_error(builder->build(state, place.between, {}), place.between,
                                           full.frequency_Hz, full.between);
      compared.push_back(std::move(one));
    }
    (void)report(total, total);
  }

  nb::dict result;
  result["frequency_Hz"] = array(full.frequency_Hz);
  result["compliance_m_N"] =
      column<double>(full.at_node, [](const Eigen::Matrix3cd& c) { return host::norm(c); });
  nb::list list;
  for (const Compared& one : compared) {
    nb::dict entry;
    entry["modes"] = one.model.modes();
    entry["basis"] = one.model.basis.size();
    entry["damping_coupling"] = one.model.damping_coupling;
    entry["at_node"] = array(one.at_node.relative);
    entry["between_nodes"] = array(one.between.relative);
    list.append(entry);
  }
  result["models"] = list;
  return result;
}

}  // namespace palpate::python
