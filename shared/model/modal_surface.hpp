// The surface of a local model as contact sees it: nodes moved by modes, evaluated only where they are asked
// for.
#pragma once

#include <array>
#include <cstdint>

#include "shared/contact/contact.hpp"
#include "shared/model/local_model.hpp"
#include "shared/model/near_field.hpp"
#include "shared/servo_tick.hpp"

namespace palpate {

// Triangles around a node that its normal is made of; more than in any lattice. Further ones are left out.
inline constexpr std::size_t kMaxTrianglesOfNode = 8;

// Steps for which a node's normal is used before it is computed anew. It takes the positions of all nodes
// around; every 4 ticks instead of every tick, models catch up sooner (docs/decisions/smooth_normals.md).
inline constexpr std::uint32_t kNormalLifetime_steps = 4;

// Steps between two computations of the near field; while a model catches up, fewer of them
// (firmware/core/renderer).
inline constexpr std::uint32_t kNearPeriod_steps = 2;

inline constexpr std::uint32_t kWorkOfTriangleTest = 250;  // Cortex-M4F instructions

// What parts of a step take, in Cortex-M4F instructions.
struct ModalSurfaceWork {
  std::uint32_t step = 0, pass = 0, new_point = 0, node = 0;  // pass: over all modes
};

// Works on a LocalModelView and a ModalState that the owner keeps alive. Positions relative to the view's
// origin_m.
class ModalSurface {
 public:
  using Real = float;
  // Inverting an exactly sampled displacement response rings: its sampling zero tends to -1. Position plus
  // half a tick of velocity has its zero at 0 for a mass, inside the unit circle with damping
  // (docs/decisions/contact_output.md).
  static constexpr float kOutputExtrapolation = 0.5f;

  // Starts on a checked model. Positions are those of `state` as it is now.
  void bind(const LocalModelView& model, ModalState& state);

  // So that the force is the body's mean of the tick while the tip moves steadily: the host's to say
  // (host/linearize/target_extrapolation.hpp).
  [[nodiscard]] float target_extrapolation() const { return model_.target_extrapolation(); }
  [[nodiscard]] static constexpr float step_s() { return static_cast<float>(kTick_s); }
  [[nodiscard]] SurfaceKind kind() const { return model_.surface; }
  [[nodiscard]] std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(model_.triangles); }
  [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t triangle) const {
    const std::uint8_t* c = model_.corner + 3 * triangle;
    return {c[0], c[1], c[2]};
  }
  [[nodiscard]] std::int32_t neighbour(std::uint32_t triangle, std::uint32_t corner) const {
    return neighbour_[triangle][corner];
  }
  [[nodiscard]] Friction<float> friction(std::uint32_t triangle) const {
    const std::uint8_t index = model_.triangle_friction[triangle];
    return {model_.static_friction[index], model_.kinetic_friction[index]};
  }
  // Near within the patch's bounding box and a margin, but for a noted clearance; then all nodes are
  // evaluated, for the collision search.
  Nearness nearness(const Vec3f& from, const Vec3f& to, float tip_radius_m);
  bool may_touch(std::uint32_t, const Vec3f&, const Vec3f&, float) {
    work_ += kWorkOfTriangleTest;
    return true;
  }
  Vec3f position(std::uint32_t node);
  [[nodiscard]] Vec3f position_before(std::uint32_t node) const { return before_[node]; }

  void note_clearance(float clearance_m) { clearance_m_ = clearance_m; }
  void prepare(std::uint32_t triangle);
  Vec3f normal_before(std::uint32_t triangle, const Vec3f& barycentric);
  void advance();
  PointResponse<float> respond(std::uint32_t triangle, const Vec3f& barycentric);
  void apply(std::uint32_t triangle, const Vec3f& barycentric, const Vec3f& force_N);

  // How often the near field is computed, in steps; at least 2. kNearPeriod_steps after bind().
  void set_near_period(std::uint32_t steps);

  // What was computed since bind(), in Cortex-M4F instructions (a good estimate; modulo 2^32).
  [[nodiscard]] std::uint32_t work() const { return work_; }
  // Of it, for the near field; and what the next step will take for that.
  [[nodiscard]] std::uint32_t near_work() const { return near_work_; }
  [[nodiscard]] std::uint32_t next_near_work() const;

 private:
  // In the step with this number (step_ counts them).
  [[nodiscard]] bool normal_is_fresh(std::uint32_t node, std::uint32_t step) const;
  Vec3f node_normal_before(std::uint32_t node);
  void quantize(const float* q);
  [[nodiscard]] Vec3f of_quantized(std::uint32_t node) const;
  [[nodiscard]] float largest_travel_m() const;
  [[nodiscard]] bool is_moved(std::uint32_t node) const;
  void load_point(std::uint32_t triangle, const Vec3f& barycentric);
  void moved();
  void pause_near_field();
  void step_near_field();
  void project_near_field();

  LocalModelView model_{};
  ModalState* state_ = nullptr;
  NearField near_;
  std::array<float, kMaxNearModes> near_load_{},
      near_rise_{};  // modal forces of the near field, and their rise in a step
  std::uint32_t near_period_ = kNearPeriod_steps,
                near_acting_ = kNearPeriod_steps;  // the latter: of near_load_
  std::uint32_t near_age_ = 0;                     // steps since the nodes' positions were taken
  bool near_due_ = true;                           // it has not been since bind() or a pause
  bool near_waiting_ = false;                      // forces wait to be projected
  bool near_paused_ = true;                        // no springs are near, and none act any more
  std::uint32_t near_work_ = 0;
  std::array<std::int16_t, kMaxModes> quantized_{};  // basis_scale * q or * p, in steps of quantum_
  float quantum_ = 0;
  bool q_is_quantized_ = false;  // as it is now
  // Of the contact point that was asked about last.
  static constexpr std::uint32_t kNoPoint = 0xffffffffu;
  std::uint32_t point_triangle_ = kNoPoint;
  Vec3f point_barycentric_{}, point_rest_m_{};
  Mat3f point_compliance_m_N_{};
  float point_skin_m_N_ = 0;
  std::array<std::array<float, kMaxModes>, 3> point_basis_{};  // scaled
  std::array<Vec3f, kMaxSurfaceNodes> now_{}, before_{};
  std::uint32_t now_valid_ = 0;  // bit per node
  std::uint32_t fixed_ = 0;      // bit per node: no mode moves it
  std::array<std::array<std::int8_t, 3>, kMaxTriangles> neighbour_{};
  // Triangles around each node, and the normal there: the mean of theirs, weighted by area.
  std::array<std::array<std::uint8_t, kMaxTrianglesOfNode>, kMaxSurfaceNodes> triangles_of_{};
  std::array<std::uint8_t, kMaxSurfaceNodes> triangle_count_of_{};
  std::array<Vec3f, kMaxSurfaceNodes> normal_{};
  std::array<std::uint32_t, kMaxSurfaceNodes> normal_step_{};  // step_ + 1 of its computation; 0: never
  std::uint32_t step_ = 0;                                     // since bind()
  Vec3f lowest_m_{}, highest_m_{};                             // bounding box at q = 0
  float margin_m_ = 0;
  float clearance_m_ = 0;  // the tip is at least this far outside; 0 or less: not known
  std::uint32_t work_ = 0;
  ModalSurfaceWork of_{};
};

static_assert(kMaxSurfaceNodes <= 32, "now_valid_ has a bit per node");
static_assert(kMaxTriangles <= 127, "neighbour_ is int8");

}  // namespace palpate
