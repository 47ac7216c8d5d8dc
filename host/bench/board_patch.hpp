// A local model of a lattice body as the board holds it, without the board around it.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "host/linearize/patch_builder.hpp"
#include "host/msd/body.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/math/linear.hpp"
#include "shared/model/local_model.hpp"
#include "shared/wire/model_contents.hpp"

namespace palpate::host::bench {

// The paper's 4x4x2 patch around the surface point nearest to `near_m`, as the wire carries it: single
// precision, basis rounded to 16 bits.
class BoardPatch {
 public:
  BoardPatch(const Body& body, const BodyState& state, const Eigen::Vector3d& near_m, SurfaceKind kind,
             double friction);
  BoardPatch(const BoardPatch&) = delete;  // the view points into the message
  BoardPatch& operator=(const BoardPatch&) = delete;

  [[nodiscard]] const LocalModel& model() const { return model_; }
  [[nodiscard]] const LocalModelView& view() const { return view_; }
  [[nodiscard]] ModalState& state() { return state_; }
  // Device frame to the patch's.
  [[nodiscard]] Vec3f to_patch(const Vec3d& position_m) const;
  // How far a point of a triangle has come since `before`, computed in double from the modes.
  [[nodiscard]] Vec3d moved_m(const ModalState& before, std::uint32_t triangle,
                              const Vec3d& barycentric) const;
  // Sum of p^2 / 2 + lambda q^2 / 2 - load q.
  [[nodiscard]] double energy_J() const;

 private:
  LocalModel model_;
  std::unique_ptr<wire::ModelContents> message_;
  LocalModelView view_{};
  ModalState state_{};
};

ContactState<double> widen_contact(const ContactState<float>& contact);

}  // namespace palpate::host::bench
