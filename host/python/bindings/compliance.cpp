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
#include "host/linearize/damping_error.hpp"
#include "host/linearize/growth_limit.hpp"
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
  std::vector<double> damping_bound, damping_error;  // at the node; 0 at 0 Hz
};

// What the model's modes leave out of its damping costs at the node.
void add_damping(Compared& one, const host::SurfacePoint& node, const std::vector<double>& frequency_Hz) {
  const host::LocalModel& model = one.model;
  const Eigen::Matrix3Xd phi = host::modes_at(model, node);
  const double eta = host::damping_coupling_norm(model.damping_1_s);
  for (const double hertz : frequency_Hz) {
    const double w = 2.0 * std::numbers::pi * hertz;
    one.damping_bound.push_back(
        w > 0 ? host::damping_error_bound(phi, model.lambda_rad2_s2, model.damping_1_s, eta, w) : 0.0);
    one.damping_error.push_back(w > 0 ? host::damping_error(phi, model.lambda_rad2_s2, model.damping_1_s, w)
                                      : 0.0);
  }
}

struct Body {
  std::vector<double> frequency_Hz;
  std::vector<Eigen::Matrix3cd> at_node, between;
};

}  // namespace

nb::dict compliance_errors(const nb::dict& scene, int node, const nb::list& models, double press_m,
                           const nb::callable& progress) {
  const host::Body body = read_body(scene);
  const double step_s = kTick_s / whole(table(scene, "integrator"), "steps_per_tick");
  const double valid_s = kTick_s * whole(table(scene, "model"), "valid_ticks");
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
      const auto build = [&](const host::SurfacePoint& at) {
        host::LocalModel model = builder->build(state, at, {});
        host::limit_growth(model, valid_s);
        return model;
      };
      Compared one{build(place.node), {}, {}, {}, {}};
      one.at_node = host::compliance_error(one.model, place.node, full.frequency_Hz, full.at_node);
      one.between =
          host::compliance_error(build(place.between), place.between, full.frequency_Hz, full.between);
      add_damping(one, place.node, full.frequency_Hz);
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
    entry["damping_bound"] = array(one.damping_bound);
    entry["damping_error"] = array(one.damping_error);
    entry["limited_modes"] = one.model.limited_modes;
    entry["at_node"] = array(one.at_node.relative);
    entry["between_nodes"] = array(one.between.relative);
    list.append(entry);
  }
  result["models"] = list;
  return result;
}

}  // namespace palpate::python
