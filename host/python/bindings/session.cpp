// The host's side of a session, step by step.
#include "host/session/session.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>

#include "host/msd/vectors.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "host/python/bindings/scene.hpp"

namespace palpate::python {
namespace {

class HostSession {
 public:
  HostSession(const nb::dict& scene, const std::string& cache_folder)
      : body_(std::make_unique<host::Body>(read_body(scene))),
        session_(std::make_unique<host::Session>(*body_, read_start(scene, *body_),
                                                 read_closed_loop(scene, *body_, cache_folder).session)) {}

  void take(std::uint32_t first_tick, const Positions& tip_m) {
    const Eigen::Matrix3Xd tips_m = to_columns(tip_m, "tip_m");
    constexpr Eigen::Index kPerMessage = palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_;
    for (Eigen::Index begin = 0; begin < tips_m.cols(); begin += kPerMessage) {
      palpate_ServoTrace_1_0 trace{};
      trace.first_tick = first_tick + static_cast<std::uint32_t>(begin);
      const Eigen::Index count = std::min(kPerMessage, tips_m.cols() - begin);
      trace.samples.count = static_cast<std::size_t>(count);
      for (Eigen::Index i = 0; i < count; ++i)
        for (Eigen::Index axis = 0; axis < 3; ++axis)
          trace.samples.elements[i].tip_m[axis] = static_cast<float>(tips_m(axis, begin + i));
      session_->take(trace);
    }
  }

  nb::object update() {
    std::optional<host::ModelUpdate> made;
    {
      const nb::gil_scoped_release no_gil;
      made = session_->update();
    }
    // Who has no board has nobody to tell that nothing is near.
    if (!made || made->says_nothing()) return nb::none();
    nb::dict result;
    result["tick"] = session_->tick();
    result["sequence"] = made->packed.state.sequence;
    result["modes"] = made->message.modes;
    result["patch_nodes"] = column<std::int32_t>(made->patch_nodes, [](int node) { return node; });
    result["basis_bytes"] = made->packed.basis == nullptr ? std::size_t{0} : made->packed.basis->size();
    result["interpolated_ticks"] = made->interpolated_ticks;
    result["damping_coupling"] = made->damping_coupling;
    result["limited_modes"] = made->limited_modes;
    return result;
  }

  [[nodiscard]] const host::Session& session() const { return *session_; }

 private:
  std::unique_ptr<host::Body> body_;  // stays where it is: the session refers to it
  std::unique_ptr<host::Session> session_;
};

}  // namespace

void bind_session(nb::module_& module) {
  using namespace nanobind::literals;
  nb::class_<HostSession>(module, "Session")
      .def(nb::init<const nb::dict&, const std::string&>(), "scene"_a, "cache_folder"_a)
      .def("take", &HostSession::take, "first_tick"_a, "tip_m"_a)
      .def(
          "due", [](const HostSession& s, std::uint32_t tick) { return s.session().due(tick); }, "tick"_a)
      .def("update", &HostSession::update)
      .def_prop_ro("tick", [](const HostSession& s) { return s.session().tick(); })
      .def_prop_ro("contact_mode",
                   [](const HostSession& s) { return static_cast<int>(s.session().contact().mode); })
      .def_prop_ro("force_N", [](const HostSession& s) { return vector3(s.session().contact().force_N); })
      .def_prop_ro("position_m",
                   [](const HostSession& s) { return nodes_by_3(s.session().state().position_m); })
      .def_prop_ro("velocity_m_s",
                   [](const HostSession& s) { return nodes_by_3(s.session().state().velocity_m_s); });
}

}  // namespace palpate::python
