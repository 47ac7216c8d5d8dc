#include "host/python/bindings/moving_body.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/msd/forces.hpp"
#include "host/msd/stable_step.hpp"
#include "host/msd/vectors.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/scene.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

const char* mode_name(ContactMode mode) {
  switch (mode) {
    case ContactMode::free:
      return "free";
    case ContactMode::stick:
      return "stick";
    case ContactMode::slip:
      return "slip";
  }
  return "unknown";
}

nb::dict touch_dict(const host::BodyTick& tick) {
  nb::dict result;
  result["force_N"] = vector3(tick.mean_force_N);
  result["mode"] = mode_name(tick.contact.mode);
  result["normal"] = vector3(tick.normal);
  result["triangle"] = tick.contact.mode == ContactMode::free ? -1 : static_cast<int>(tick.contact.triangle);
  return result;
}

template <class Get>
nb::object of_springs(const MovingBody& moving, Get get) {
  return column<double>(moving.body().springs(), get);
}

int checked_node(const host::Body& body, int node) {
  if (node < 0 || node >= body.node_count())
    throw std::invalid_argument("node = " + std::to_string(node) + ": must be in [0, " +
                                std::to_string(body.node_count() - 1) + "]");
  return node;
}

}  // namespace

Eigen::Matrix3Xd to_columns(const Positions& rows, const char* name) {
  Eigen::Matrix3Xd columns = Eigen::Map<const Eigen::Matrix3Xd>(rows.data(), 3, Eigen::Index(rows.shape(0)));
  if (!columns.allFinite()) throw std::invalid_argument(std::string(name) + ": must be finite numbers");
  return columns;
}

Vec3d to_vector(const Vector& v, const char* name) {
  const Vec3d vector{v.data()[0], v.data()[1], v.data()[2]};
  if (!std::isfinite(vector.x) || !std::isfinite(vector.y) || !std::isfinite(vector.z))
    throw std::invalid_argument(std::string(name) + ": must be finite numbers");
  return vector;
}

MovingBody::MovingBody(const nb::dict& scene)
    : body_(read_body(scene)),
      method_(read_method(scene)),
      step_s_(kTick_s / whole(table(scene, "integrator"), "steps_per_tick")),
      law_(read_contact(scene)),
      kind_(read_surface(scene)),
      friction_(read_friction(scene)),
      state_(read_start(scene, body_)) {
  set_drives(read_drives(scene, body_));
}

void MovingBody::set_state(const Positions& position_m, const Positions& velocity_m_s) {
  const auto nodes = static_cast<std::size_t>(body_.node_count());
  if (position_m.shape(0) != nodes || velocity_m_s.shape(0) != nodes)
    throw std::invalid_argument("state: must have " + std::to_string(nodes) + " rows, one per node");
  host::BodyState state{to_columns(position_m, "position_m"), to_columns(velocity_m_s, "velocity_m_s")};
  if (!drives_.empty()) throw std::invalid_argument("state: not while nodes are driven");
  leave_surface();
  state_ = std::move(state);
}

void MovingBody::set_drives(std::vector<host::NodeDrive> drives) {
  leave_surface();
  (void)host::NodeDrives(body_, drives, step_s_);  // throws
  drives_ = std::move(drives);
}

host::BodySurface& MovingBody::surface() {
  if (!surface_) {
    if (method_ != host::Method::semi_implicit_euler)
      throw std::invalid_argument(
          "integrator.method: must be \"semi_implicit\" for a tip and for driven nodes");
    surface_ = std::make_unique<host::BodySurface>(body_, state_, step_s_, kind_, drives_, friction_);
  }
  return *surface_;
}

void MovingBody::leave_surface() {
  if (surface_) state_ = surface_->state();
  surface_.reset();
  contact_ = {};
  tip_m_.reset();
}

void MovingBody::step(std::uint32_t steps, const std::vector<host::NodalForce>& forces) {
  if (!drives_.empty()) {
    if (!forces.empty()) throw std::invalid_argument("forces: not while nodes are driven");
    contact_ = {};
    tip_m_.reset();
    for (std::uint32_t i = 0; i < steps; ++i) surface().advance();
  } else {
    leave_surface();
    if (!integrator_) integrator_ = host::make_integrator(method_, body_);
    for (std::uint32_t i = 0; i < steps; ++i) integrator_->step(state_, forces, step_s_);
  }
  time_s_ += steps * step_s_;
}

host::BodyTick MovingBody::touch(const Vec3d& tip_m) {
  if (body_.triangles().empty())
    throw std::invalid_argument("body.dimension = 2: must be 3 for a body that is touched");
  const Vec3d from_m = tip_m_.value_or(tip_m);
  const host::BodyTick tick = host::advance_tick(surface(), contact_, law_, from_m, tip_m);
  tip_m_ = tip_m;
  time_s_ += kTick_s;
  return tick;
}

void bind_body(nb::module_& module) {
  using namespace nanobind::literals;
  nb::class_<MovingBody>(module, "Body")
      .def(nb::init<const nb::dict&>(), "scene"_a)
      .def_prop_ro("node_count", [](const MovingBody& m) { return m.body().node_count(); })
      .def_prop_ro("step_s", &MovingBody::step_s)
      .def_prop_ro("time_s", &MovingBody::time_s)
      .def_prop_ro("rest_m", [](const MovingBody& m) { return nodes_by_3(m.body().rest_position_m()); })
      .def_prop_ro("position_m", [](const MovingBody& m) { return nodes_by_3(m.state().position_m); })
      .def_prop_ro("velocity_m_s", [](const MovingBody& m) { return nodes_by_3(m.state().velocity_m_s); })
      .def_prop_ro("mass_kg",
                   [](const MovingBody& m) {
                     std::vector<double> mass_kg;
                     mass_kg.reserve(static_cast<std::size_t>(m.body().node_count()));
                     for (int n = 0; n < m.body().node_count(); ++n) mass_kg.push_back(m.body().mass_kg(n));
                     return array(std::move(mass_kg));
                   })
      .def_prop_ro("fixed_nodes",
                   [](const MovingBody& m) {
                     std::vector<std::int32_t> fixed;
                     for (int n = 0; n < m.body().node_count(); ++n)
                       if (m.body().fixed(n)) fixed.push_back(n);
                     return array(std::move(fixed));
                   })
      .def_prop_ro("triangles",
                   [](const MovingBody& m) {
                     return columns3<std::int32_t>(m.body().triangles(),
                                                   [](const host::Triangle& t) { return t; });
                   })
      .def_prop_ro("springs",
                   [](const MovingBody& m) {
                     std::vector<std::int32_t> ends;
                     for (const host::Spring& s : m.body().springs()) ends.insert(ends.end(), {s.i, s.j});
                     return array(std::move(ends), 2);
                   })
      .def_prop_ro("spring_stiffness_N_m",
                   [](const MovingBody& m) {
                     return of_springs(m, [](const host::Spring& s) { return s.stiffness_N_m; });
                   })
      .def_prop_ro("spring_damping_N_s_m",
                   [](const MovingBody& m) {
                     return of_springs(m, [](const host::Spring& s) { return s.damping_N_s_m; });
                   })
      .def(
          "node",
          [](const MovingBody& m, int i, int j, int k) {
            if (!m.body().lattice()) throw std::invalid_argument("node: a mesh has no indices [i, j, k]");
            const host::LatticeShape& shape = *m.body().lattice();
            const std::array<int, 3> index{i, j, k};
            for (std::size_t axis = 0; axis < 3; ++axis)
              if (index[axis] < 0 || index[axis] >= shape.nodes[axis])
                throw std::invalid_argument(std::string(1, "ijk"[axis]) + " = " +
                                            std::to_string(index[axis]) + ": must be in [0, " +
                                            std::to_string(shape.nodes[axis] - 1) + "]");
            return shape.node(i, j, k);
          },
          "i"_a, "j"_a, "k"_a)
      .def("stable_step_s",
           [](const MovingBody& m) { return host::stable_step_s(m.body(), m.state().position_m); })
      .def("forces_N",
           [](const MovingBody& m) {
             Eigen::Matrix3Xd force_N;
             host::ForceEvaluator(m.body()).evaluate(m.state(), force_N);
             return nodes_by_3(force_N);
           })
      .def("set_state", &MovingBody::set_state, "position_m"_a, "velocity_m_s"_a)
      .def(
          "set_drives",
          [](MovingBody& m, const std::vector<int>& node, const std::vector<double>& start_s,
             const std::vector<double>& reach_s, const std::vector<double>& release_s,
             const Positions& displacement_m) {
            const Eigen::Matrix3Xd to_m = to_columns(displacement_m, "displacement_m");
            std::vector<host::NodeDrive> drives;
            drives.reserve(node.size());
            for (std::size_t i = 0; i < node.size(); ++i)
              drives.push_back({checked_node(m.body(), node[i]), start_s.at(i), reach_s.at(i),
                                release_s.at(i), host::from_eigen(to_m.col(Eigen::Index(i)))});
            m.set_drives(std::move(drives));
          },
          "node"_a, "start_s"_a, "reach_s"_a, "release_s"_a, "displacement_m"_a)
      .def(
          "step",
          [](MovingBody& m, std::uint32_t steps, const std::vector<int>& node, const Positions& force_N) {
            const Eigen::Matrix3Xd given_N = to_columns(force_N, "force_N");
            std::vector<host::NodalForce> forces;
            forces.reserve(node.size());
            for (std::size_t i = 0; i < node.size(); ++i)
              forces.push_back(
                  {checked_node(m.body(), node[i]), host::from_eigen(given_N.col(Eigen::Index(i)))});
            const nb::gil_scoped_release no_gil;
            m.step(steps, forces);
          },
          "steps"_a, "node"_a, "force_N"_a)
      .def(
          "touch",
          [](MovingBody& m, const Vector& tip_m) { return touch_dict(m.touch(to_vector(tip_m, "tip_m"))); },
          "tip_m"_a);
}

}  // namespace palpate::python
