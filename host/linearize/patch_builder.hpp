// The paper's local model (section 2.3): the tangent of the nodes around the contact, everything outside
// held.
//
// Linearized about X0, V0 (equation (3)), with x = X - X0 and v = V - V0 of the patch's free nodes, x = v = 0
// outside:
//   M v' = f0 - K x - D v + f,   K = -df/dX,  D = -df/dV,  f0 = f(X0, V0) without contact,  f the contact
//   force.
// The modes step the whole velocity x' = V, so with x = Phi q, x' = Phi p, p0 = Phi' M V0 and Phi' M Phi = I:
//   p' = -diag(lambda) q - diag(d) (p - p0) + Phi' f0 + Phi' f
//      = -lambda q - d p + load + Phi' f,   load = Phi' f0 + d * p0.
// At the start (q = 0, p = p0) the acceleration is Phi' (f0 + f): that of the non-linear body, whatever the
// off-diagonal damping that diag(d) leaves out. Over time the load treats the nodes outside as held in place
// but their dampers as still moving with V0, as equation (3) does; it is meant for the time until the next
// model.
#pragma once

#include "host/linearize/local_model.hpp"
#include "host/linearize/model_surface.hpp"
#include "host/linearize/patch_selection.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// What is around the nodes of a model instead of nodes that are held; by default nothing else. softening_N_m:
// taken from the stiffness, in the degrees of freedom of subset_tangent, or empty; outside: factor on springs
// and dampers to free nodes that are not of the model.
struct Surroundings {
  double outside = 1.0;
  Eigen::MatrixXd softening_N_m;
};

// Linear model of any set of nodes, others held. The surface is cut to the capacity around the contact
// (subset_surface); more modes than the capacity throw std::invalid_argument. `held`: nodes, ascending, that
// count as fixed although they are not (driven ones, host/msd/node_drives.hpp): they stay in place like the
// nodes outside, whatever their velocity. A set of fixed nodes only gives a model with no modes: a rigid
// surface.
LocalModel build_subset_model(const Body& body, const BodyState& state, const std::vector<int>& nodes,
                              const SurfacePoint& contact, double step_s,
                              const LocalModelCapacity& capacity = {}, const std::vector<int>& held = {},
                              const Surroundings& around = {});

// The same for the patch around the contact point. Throws as select_patch and build_subset_model do.
LocalModel build_patch(const Body& body, const BodyState& state, const SurfacePoint& contact,
                       const PatchSize& size, double step_s, const LocalModelCapacity& capacity = {},
                       const std::vector<int>& held = {});

}  // namespace palpate::host
