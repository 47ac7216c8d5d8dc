#include "host/linearize/krylov_builder.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/linearize/modal_reduction.hpp"
#include "host/linearize/projection.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {
namespace {

// Springs whose tangent has changed by less than this part of their stiffness count as at rest: so far from
// the contact the body hardly bends (docs/decisions/whole_body.md has what it costs and saves).
constexpr double kUnchanged = 3e-2;

// With nodes below the surface a model has as many nodes as the capacity allows.
int most_modes(const LocalModelCapacity& capacity, int near_nodes) {
  if (near_nodes == 0) return capacity.modes;
  return std::min(capacity.modes, capacity.basis / (3 * capacity.surface_nodes));
}

// The surface nodes of a model that has no more modes than that.
int most_ports(const Shifts& shifts, const LocalModelCapacity& capacity, int near_nodes) {
  int ports = capacity.surface_nodes;
  while (ports > 0 && shifts.most_modes(ports + near_nodes) > most_modes(capacity, near_nodes)) --ports;
  return ports;
}

struct Reduced {
  Eigen::MatrixXd stiffness, damping;  // modes x modes
};

// Phi' K Phi and Phi' B Phi: those at rest, and what the changed springs add.
Reduced changed(const Body& body, const std::vector<TangentChange>& changes, const StoredBasis& span) {
  const Eigen::Index modes = span.lambda_rad2_s2.size(), springs = std::ssize(changes);
  // Transposed, so that a spring's part lies together in memory: 3 columns each.
  Eigen::MatrixXd separation = Eigen::MatrixXd::Zero(modes, 3 * springs);
  Eigen::MatrixXd force(modes, 3 * springs), drag(modes, 3 * springs);
  for (Eigen::Index s = 0; s < springs; ++s) {
    const TangentChange& change = changes[static_cast<std::size_t>(s)];
    for (const int axis : body.axes()) {
      if (const int dof = body.dof(change.j, axis); dof >= 0)
        separation.col(3 * s + axis) += span.basis_1_sqrt_kg.row(dof).transpose().cast<double>();
      if (const int dof = body.dof(change.i, axis); dof >= 0)
        separation.col(3 * s + axis) -= span.basis_1_sqrt_kg.row(dof).transpose().cast<double>();
    }
    const auto part = separation.middleCols<3>(3 * s);
    force.middleCols<3>(3 * s) = part * change.stiffness_N_m;
    drag.middleCols<3>(3 * s) = part * change.damping_N_s_m;
  }
  Reduced reduced{force * separation.transpose(), drag * separation.transpose()};
  reduced.stiffness.diagonal() += span.lambda_rad2_s2;
  reduced.damping += span.damping_1_s;
  return reduced;
}

// Sets the degrees of freedom of these nodes, and their rows of the span.
void set_dofs(LocalModel& model, const Body& body, const StoredBasis& span, const std::vector<int>& nodes) {
  std::vector<int> rows;
  for (const int node : nodes) {
    for (const int axis : body.axes()) {
      if (body.dof(node, axis) < 0) continue;
      model.dof_node.push_back(node);
      model.dof_axis.push_back(axis);
      rows.push_back(body.dof(node, axis));
    }
  }
  model.dof_basis = span.basis_1_sqrt_kg(rows, Eigen::all).cast<double>();
}

}  // namespace

KrylovBuilder::KrylovBuilder(const Body& body, const PatchSize& patch, TangentAt at, const Shifts& shifts,
                             double step_s, const LocalModelCapacity& capacity, const BasisPolicy& bases,
                             int near_nodes)
    : body_(body),
      at_(at),
      step_s_(step_s),
      capacity_(capacity),
      port_limit_(most_ports(shifts, capacity, near_nodes)),
      patches_(body, patch, port_limit_, shifts, bases, near_nodes),
      forces_(body),
      excitation_(body.dof_count(), 2),
      bent_(body) {
  if (port_limit_ < patch.along_first * patch.along_second)
    throw std::invalid_argument(
        "the local model has " +
        std::to_string(shifts.most_modes(patch.along_first * patch.along_second + near_nodes)) +
        " modes, 3 for each node in them and frequency, allowed: at most " +
        std::to_string(most_modes(capacity, near_nodes)));
}

std::uint32_t KrylovBuilder::foresight_ticks() const {
  const BasisPolicy& policy = patches_.source().policy();
  return policy.timing == BasisTiming::waits ? 0 : std::max(1U, policy.latency_ticks);
}

const KrylovBuilder::AtRest& KrylovBuilder::at_rest(std::shared_ptr<const StoredBasis> span,
                                                    const std::vector<int>& nodes) {
  if (at_rest_.span == span && at_rest_.nodes == nodes) return at_rest_;
  LocalModel model;
  // The span's modes are those of the tangent at rest.
  model.lambda_rad2_s2 = span->lambda_rad2_s2;
  model.damping_rad_s = span->damping_1_s.diagonal();
  model.damping_1_s = span->damping_1_s;
  const Eigen::MatrixXd coupling = span->damping_1_s - Eigen::MatrixXd(model.damping_rad_s.asDiagonal());
  if (const double all = span->damping_1_s.norm(); all > 0) model.damping_coupling = coupling.norm() / all;
  set_step(model, step_s_);
  set_dofs(model, body_, *span, nodes);
  at_rest_ = {std::move(span), nodes, std::move(model)};
  return at_rest_;
}

LocalModel KrylovBuilder::of_frame(const BodyState& state, const StoredBasis& span,
                                   const std::vector<int>& nodes, Eigen::MatrixXd& modes) {
  bent_.find(state, kUnchanged, changes_);
  const auto [stiffness, damping] = changed(body_, changes_, span);
  ModalBasis turned = reduce_to_modes(stiffness, damping, Eigen::VectorXd::Ones(span.lambda_rad2_s2.size()));
  LocalModel model;
  model.lambda_rad2_s2 = std::move(turned.lambda_rad2_s2);
  model.damping_rad_s = std::move(turned.damping_rad_s);
  model.damping_1_s = std::move(turned.damping_1_s);
  model.damping_coupling = turned.damping_coupling;
  model.stiffness_asymmetry = turned.stiffness_asymmetry;
  set_step(model, step_s_);
  set_dofs(model, body_, span, nodes);
  model.dof_basis *= turned.basis_1_sqrt_kg;
  modes = std::move(turned.basis_1_sqrt_kg);
  return model;
}

Eigen::MatrixXd KrylovBuilder::projected(const BodyState& state, const StoredBasis& span) {
  forces_.evaluate(state, force_N_);
  for (int node = 0; node < body_.node_count(); ++node) {
    for (const int axis : body_.axes()) {
      const int dof = body_.dof(node, axis);
      if (dof < 0) continue;
      excitation_(dof, 0) = force_N_(axis, node);
      excitation_(dof, 1) = body_.mass_kg(node) * state.velocity_m_s(axis, node);
    }
  }
  return project(span.basis_1_sqrt_kg, excitation_);
}

LocalModel KrylovBuilder::build(const BodyState& state, const SurfacePoint& contact,
                                const std::vector<int>& held) {
  if (!held.empty())
    throw std::invalid_argument("node " + std::to_string(held.front()) +
                                " is driven: the whole body's modes do not know driven nodes");
  const PatchBasis* patch = patches_.at(contact);
  if (patch == nullptr) return {};
  const std::vector<int>& nodes = patch->nodes;
  const std::shared_ptr<const StoredBasis>& span = patch->span;
  // All surface nodes of the patch are ports, so that the basis can be used again; where the model has no
  // room for all of them, it has those nearest to the contact.
  SubsetSurface surface = patch->surface;
  const Eigen::Index count = span->lambda_rad2_s2.size();
  if (surface_limit(capacity_, count) < static_cast<int>(surface.node.size()))
    surface = subset_surface(body_, nodes, contact, surface_limit(capacity_, count));

  Eigen::MatrixXd modal = projected(state, *span);
  LocalModel model;
  if (at_ == TangentAt::rest) {
    model = at_rest(span, nodes).model;
  } else {
    Eigen::MatrixXd modes;
    model = of_frame(state, *span, nodes, modes);
    modal = modes.transpose() * modal;
  }
  model.q = Eigen::VectorXd::Zero(count);
  model.p = modal.col(1);
  model.load = modal.col(0) + model.damping_rad_s.cwiseProduct(model.p);
  set_surface(model, state, std::move(surface), std::move(model.dof_node), std::move(model.dof_axis),
              std::move(model.dof_basis));
  if (at_ == TangentAt::rest) {
    set_rest(model, body_);
    model.chosen_around = patch->chosen_around;
  }
  return model;
}

}  // namespace palpate::host
