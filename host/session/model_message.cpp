#include "host/session/model_message.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "host/linearize/target_extrapolation.hpp"

namespace palpate::host {
namespace {

constexpr double kLargestEntry = 32767.0;

float narrow(double value) {
  const auto narrowed = static_cast<float>(value);
  if (!std::isfinite(narrowed)) {
    std::ostringstream message;
    message << "local model: number " << value << " does not fit in single precision";
    throw std::invalid_argument(message.str());
  }
  return narrowed;
}

void require_at_most(std::size_t count, std::size_t bound, const char* what) {
  if (count <= bound) return;
  std::ostringstream message;
  message << "local model: " << what << " = " << count << ": must be at most " << bound;
  throw std::invalid_argument(message.str());
}

void pack(const Vec3d& from, float* to) {
  for (std::size_t axis = 0; axis < 3; ++axis) to[axis] = narrow(from[axis]);
}

void pack_contact(const ContactState<double>& contact, palpate_Contact_1_0& message) {
  message.mode = static_cast<std::uint8_t>(contact.mode);
  message.triangle =
      contact.mode == ContactMode::free ? std::uint16_t{0} : static_cast<std::uint16_t>(contact.triangle);
  pack(contact.mode == ContactMode::free ? Vec3d{} : contact.barycentric, message.barycentric);
  pack(contact.force_N, message.force_N);
  pack(contact.stretch_m, message.coupling_stretch_m);
  message.inset_m = narrow(contact.inset_m);
  pack(contact.overhang_m, message.overhang_m);
  message.height_m = contact.mode == ContactMode::free ? 0.0f : narrow(contact.height_m);
}

void pack_stamp(const ModelStamp& stamp, ModelKind kind, const ContactLaw<double>& law,
                const ContactState<double>& contact, wire::ModelContents& message) {
  message = {};
  message.sequence = stamp.sequence;
  message.schema_hash = wire::kSchemaHash;
  message.tick = stamp.tick;
  message.valid_ticks = stamp.valid_ticks;
  message.growth_ticks = stamp.growth_ticks;
  message.tip_radius_m = narrow(law.tip_radius_m);
  message.coupling_stiffness_N_m = narrow(law.coupling.stiffness_N_m);
  message.coupling_damping_N_s_m = narrow(law.coupling.damping_N_s_m);
  message.tip_source = static_cast<std::uint8_t>(stamp.tip);
  message.kind = static_cast<std::uint8_t>(kind);
  pack_contact(contact, message.contact);
}

// Springs of equal constants are one kind.
void pack_springs(const LocalModel& model, wire::ModelContents& message) {
  require_at_most(model.springs.size(), kMaxSprings, "springs of the near field");
  if (!model.springs.empty())
    require_at_most(static_cast<std::size_t>(model.modes()), kMaxNearModes, "modes of a model with springs");
  std::vector<std::array<double, 3>> kinds;
  message.spring_kind.count = model.springs.size();
  message.spring_end.count = 2 * model.springs.size();
  for (std::size_t s = 0; s < model.springs.size(); ++s) {
    const Spring& spring = model.springs[s];
    const std::array<double, 3> kind{spring.stiffness_N_m, spring.damping_N_s_m, spring.rest_length_m};
    const auto found = std::find(kinds.begin(), kinds.end(), kind);
    message.spring_kind.elements[s] = static_cast<std::uint8_t>(found - kinds.begin());
    if (found == kinds.end()) kinds.push_back(kind);
    message.spring_end.elements[2 * s] = static_cast<std::uint8_t>(spring.i);
    message.spring_end.elements[2 * s + 1] = static_cast<std::uint8_t>(spring.j);
  }
  require_at_most(kinds.size(), kMaxSpringKinds, "kinds of springs of the near field");
  message.spring_stiffness_N_m.count = message.spring_damping_N_s_m.count = message.spring_length_m.count =
      kinds.size();
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    message.spring_stiffness_N_m.elements[k] = narrow(kinds[k][0]);
    message.spring_damping_N_s_m.elements[k] = narrow(kinds[k][1]);
    message.spring_length_m.elements[k] = narrow(kinds[k][2]);
  }
}

}  // namespace

void pack_held_force(const ModelStamp& stamp, const ContactLaw<double>& law,
                     const ContactState<double>& contact, wire::ModelContents& message) {
  pack_stamp(stamp, ModelKind::held_force, law, contact, message);
}

void pack_nothing(const ModelStamp& stamp, const ContactLaw<double>& law, wire::ModelContents& message) {
  pack_held_force(stamp, law, {}, message);
  message.valid_ticks = message.growth_ticks = 0;
}

void pack_model(const LocalModel& model, const ModelStamp& stamp, const ContactLaw<double>& law,
                SurfaceKind surface, const SurfaceFriction& friction, const ContactState<double>& contact,
                wire::ModelContents& message) {
  const auto modes = static_cast<std::size_t>(model.modes());
  const std::size_t nodes = model.node.size(), triangles = model.triangle.size();
  require_at_most(modes, kMaxModes, "modes");
  require_at_most(nodes, kMaxSurfaceNodes, "nodes");
  require_at_most(triangles, kMaxTriangles, "triangles");
  require_at_most(3 * nodes * modes, kMaxBasis, "entries of the basis");

  pack_stamp(stamp, stamp.kind, law, contact, message);
  message.modes = static_cast<std::uint16_t>(modes);
  message.nodes = static_cast<std::uint8_t>(nodes);
  message.surface_nodes = static_cast<std::uint8_t>(model.surface_nodes);
  message.triangles = static_cast<std::uint8_t>(triangles);
  pack({model.origin_m.x(), model.origin_m.y(), model.origin_m.z()}, message.origin_m);
  message.surface = static_cast<std::uint8_t>(surface);
  // Where the basis does not stay, neither would this: it keeps the half that is right for soft bodies.
  if (model.rest_m.size() != 0) message.target_below_half_16ths = target_below_half_16ths(model);
  message.static_friction.count = message.kinetic_friction.count = friction.different().size();
  for (std::size_t i = 0; i < friction.different().size(); ++i) {
    message.static_friction.elements[i] = narrow(friction.different()[i].static_coefficient);
    message.kinetic_friction.elements[i] = narrow(friction.different()[i].kinetic_coefficient);
  }

  message.position_m.count = 3 * nodes;
  for (std::size_t i = 0; i < 3 * nodes; ++i)
    message.position_m.elements[i] =
        narrow(model.position_m(static_cast<Eigen::Index>(i % 3), static_cast<Eigen::Index>(i / 3)));
  message.rest_m.count = static_cast<std::size_t>(model.rest_m.size());
  for (std::size_t i = 0; i < message.rest_m.count; ++i)
    message.rest_m.elements[i] =
        narrow(model.rest_m(static_cast<Eigen::Index>(i % 3), static_cast<Eigen::Index>(i / 3)));
  pack_springs(model, message);
  message.triangle_id.count = triangles;
  message.corner.count = 3 * triangles;
  message.triangle_friction.count = triangles;
  for (std::size_t t = 0; t < triangles; ++t) {
    require_at_most(static_cast<std::size_t>(model.triangle[t]), 65535, "number of a triangle");
    message.triangle_id.elements[t] = static_cast<std::uint16_t>(model.triangle[t]);
    message.triangle_friction.elements[t] = friction.index(static_cast<std::uint32_t>(model.triangle[t]));
    for (std::size_t c = 0; c < 3; ++c)
      message.corner.elements[3 * t + c] = static_cast<std::uint8_t>(model.corner[t][c]);
  }

  message.coefficient.count = kCoefficientsPerMode * modes;
  message.load.count = message.state_q.count = message.state_p.count = message.basis_scale.count = modes;
  message.basis.count = 3 * nodes * modes;
  for (std::size_t m = 0; m < modes; ++m) {
    const auto column = static_cast<Eigen::Index>(m);
    const ModalCoefficients& c = model.coefficient[m];
    const double values[] = {c.a11, c.a12, c.a21, c.a22, c.b1, c.b2};
    for (std::size_t k = 0; k < kCoefficientsPerMode; ++k)
      message.coefficient.elements[kCoefficientsPerMode * m + k] = narrow(values[k]);
    message.load.elements[m] = narrow(model.load(column));
    message.state_q.elements[m] = narrow(model.q(column));
    message.state_p.elements[m] = narrow(model.p(column));
    const float scale =
        narrow(model.basis.col(column).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / kLargestEntry);
    message.basis_scale.elements[m] = scale;
    for (std::size_t row = 0; row < 3 * nodes; ++row) {
      const double entry = model.basis(static_cast<Eigen::Index>(row), column);
      const double steps = scale > 0.0f ? std::round(entry / static_cast<double>(scale)) : 0.0;
      message.basis.elements[row * modes + m] =
          static_cast<std::int16_t>(std::fmin(std::fmax(steps, -kLargestEntry), kLargestEntry));
    }
  }
}

}  // namespace palpate::host
