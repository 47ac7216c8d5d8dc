// A body and its present state, to be stepped from Python with forces, drives or a tip.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "host/msd/integrator.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/session/body_surface.hpp"

namespace palpate::python {

// One thread. Positions and forces in the device frame.
class MovingBody {
 public:
  // Of a scene (palpate.scene.Scene.to_dict) [body], [integrator], [contact], [tool] and [coupling] count.
  // Throws as read_body does.
  explicit MovingBody(const nb::dict& scene);

  [[nodiscard]] const host::Body& body() const { return body_; }
  [[nodiscard]] const host::BodyState& state() const { return surface_ ? surface_->state() : state_; }
  // Any contact ends; drives go on. Throws std::invalid_argument for other sizes than the body's and numbers
  // that are not finite.
  void set_state(const Positions& position_m, const Positions& velocity_m_s);
  // From now on: start_s counts from here.
  void set_drives(std::vector<host::NodeDrive> drives);
  // So many steps without a tip. Throws std::invalid_argument for forces on a driven body, and as integrators
  // do.
  void step(std::uint32_t steps, const std::vector<host::NodalForce>& forces);
  // One servo tick in which the tip goes straight from where it was to tip_m; the first time it is at tip_m
  // from the beginning.
  host::BodyTick touch(const Vec3d& tip_m);

  [[nodiscard]] double step_s() const { return step_s_; }
  [[nodiscard]] double time_s() const { return time_s_; }

 private:
  host::BodySurface& surface();
  void leave_surface();

  host::Body body_;
  host::Method method_;
  double step_s_;
  ContactLaw<double> law_;
  SurfaceKind kind_;
  host::FrictionSpec friction_;
  host::BodyState state_;  // where there is no surface_
  std::vector<host::NodeDrive> drives_;
  std::unique_ptr<host::Integrator> integrator_;
  std::unique_ptr<host::BodySurface> surface_;
  ContactState<double> contact_{};
  std::optional<Vec3d> tip_m_;
  double time_s_ = 0;
};

void bind_body(nb::module_& module);
void bind_model(nb::module_& module);
void bind_session(nb::module_& module);
void bind_arm(nb::module_& module);
void bind_device(nb::module_& module);
void bind_endpoint(nb::module_& module);
void bind_live_loop(nb::module_& module);
void bind_virtual_device(nb::module_& module);

// Rows of a C-contiguous (n, 3) array; throws std::invalid_argument, naming it, where one is not finite.
Eigen::Matrix3Xd to_columns(const Positions& rows, const char* name);
Vec3d to_vector(const nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>& v,
                const char* name);
using Vector = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;

}  // namespace palpate::python
