// What contact asks of a surface: triangles that move, and how a point of them answers to a force.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>

#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// How a point of the surface answers in the step that is under way.
template <class Real>
struct PointResponse {
  Vec3<Real> free_m{};  // where it ends without a contact force
  Mat3<Real>
      compliance_m_N{};  // its displacement per force on it during the step; symmetric, positive semidefinite
  Real skin_m_N = 0;     // between it and the tip, see kSkinStiffness_N_m
};

// A fixed node does not yield, and no force would be finite where a triangle has three of them. Fixed places
// are touched through a spring of this stiffness, and a point between fixed and free nodes through a stiffer
// one, in proportion to the weight of the fixed ones. 2 kN/m: a wall that the device renders stably (the
// stiffness of the virtual coupling, too).
inline constexpr double kSkinStiffness_N_m = 2000.0;

inline constexpr std::int32_t kNoTriangle = -1;

// What a cheap test knows of a motion of the tip.
enum class Nearness : std::uint8_t {
  far,      // it cannot touch
  outside,  // nor can it, and it has been outside since the clearance was noted
  near      // it could touch
};

// A surface that can be touched. target_extrapolation() (in steps): the contact aims at the tip's place at
// the end of the step + extrapolation * its motion in the step, for a response that is ahead of the end, too;
// 0 where it is not.
template <class S>
concept ContactSurface = requires(S s, const S c, std::uint32_t i, Vec3<typename S::Real> v,
                                  typename S::Real radius) {
  { c.target_extrapolation() } -> std::convertible_to<typename S::Real>;
  { c.kind() } -> std::same_as<SurfaceKind>;
  { c.triangle_count() } -> std::convertible_to<std::uint32_t>;
  { c.corners(i) } -> std::same_as<std::array<std::uint32_t, 3>>;
  // Across the edge opposite to corner `i` of the triangle; kNoTriangle at the border.
  { c.neighbour(i, i) } -> std::convertible_to<std::int32_t>;
  // Of the material of triangle `i`.
  { c.friction(i) } -> std::same_as<Friction<typename S::Real>>;
  // Cheap test: could a tip of this radius that moves from the first to the second point touch the surface?
  // May say `near` too often.
  { s.nearness(v, v, radius) } -> std::same_as<Nearness>;
  // The tip has ended the newest step this far outside: it cannot touch again before it has come closer.
  {s.note_clearance(radius)};
  // Could triangle `i` be within reach of the same motion? May say yes too often.
  { s.may_touch(i, v, v, radius) } -> std::same_as<bool>;
  // Readies `normal_before` and `position_before` of a triangle for the step to come, where the surface is
  // flat also of all that share a node with it; nearness does so for all where it says `near`.
  {s.prepare(i)};
  // Node positions at the end and at the start of the newest step.
  { s.position(i) } -> std::same_as<Vec3<typename S::Real>>;
  { s.position_before(i) } -> std::same_as<Vec3<typename S::Real>>;
  // Unit outward normal at a point of triangle `i` at the start of the newest step: continuous across edges
  // where the surface is smooth.
  { s.normal_before(i, v) } -> std::same_as<Vec3<typename S::Real>>;
  // Length of a step.
  { c.step_s() } -> std::convertible_to<typename S::Real>;
  // One step without contact force; then the response of a point; then the force on it.
  {s.advance()};
  { s.respond(i, v) } -> std::same_as<PointResponse<typename S::Real>>;
  {s.apply(i, v, v)};
};

}  // namespace palpate
