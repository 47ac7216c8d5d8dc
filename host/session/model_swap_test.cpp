// The contact while one real local model takes over from another: a full body in a Session, the board's
// Renderer, and the link's delay between them.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "host/msd/tangent.hpp"
#include "host/msd/vectors.hpp"
#include "host/session/session.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::Path;

constexpr int kSide = 7;
constexpr double kSpacing_m = 0.01;
constexpr std::uint32_t kDelay_ticks = 8;  // from the host to the board
constexpr std::uint8_t kModelUsed = palpate_ServoSample_1_0_FLAG_MODEL_USED,
                       kModelSwap = palpate_ServoSample_1_0_FLAG_MODEL_SWAP;

Vec3d to_double(const Vec3f& v) {
  return {v.x, v.y, v.z};
}

struct Tick {
  std::uint32_t tick = 0;
  Vec3d tip_m{}, force_N{};
  ContactMode mode = ContactMode::free;
  bool used = false, swap = false;
  std::uint32_t model_tick = 0;  // of the active model
  double inset_m = 0;            // of the contact with which it came
};

// Both ends in one process.
class Loop {
 public:
  explicit Loop(const SessionConfig& config) : session_(body_, body_.rest_state(), config) {}

  Tick tick(const Vec3d& tip_m) {
    Tick result{.tick = now_, .tip_m = tip_m};
    const Vec3f tip{static_cast<float>(tip_m.x), static_cast<float>(tip_m.y), static_cast<float>(tip_m.z)};
    const firmware::ServoSample sample = renderer_->isr_tick(now_, tip);
    firmware::ModelReport report;
    if (renderer_->catch_up(report)) {
      EXPECT_TRUE(report.status == Status::ok || report.status == Status::model_superseded);
    }
    palpate_ServoTrace_1_0 trace{};
    trace.first_tick = now_;
    trace.samples.count = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) trace.samples.elements[0].tip_m[axis] = tip[axis];
    if (session_hears) session_.take(trace);
    if (session_hears && session_.due(now_)) {
      if (auto update = session_.update()) {
        if (models_arrive) under_way_.push_back({now_ + kDelay_ticks, update->message.sequence});
        sent_.push_back(std::move(*update));
      }
    }
    while (!under_way_.empty() && under_way_.front().arrives <= now_) {
      deliver(sent(under_way_.front().sequence).packed);
      under_way_.pop_front();
    }
    result.force_N = to_double(sample.force_N);
    result.mode = sample.mode;
    result.used = (sample.flags & kModelUsed) != 0;
    result.swap = (sample.flags & kModelSwap) != 0;
    if (renderer_->model_sequence() != 0) {
      const wire::ModelContents& message = sent(renderer_->model_sequence()).message;
      result.model_tick = message.tick;
      result.inset_m = static_cast<double>(message.contact.inset_m);
    }
    ++now_;
    return result;
  }
  std::vector<Tick> follow(const Path& path) {
    std::vector<Tick> ticks;
    for (const Vec3d& tip_m : path.tip_m) ticks.push_back(tick(tip_m));
    return ticks;
  }
  [[nodiscard]] const ModelUpdate& newest() const { return sent_.back(); }
  [[nodiscard]] const Body& body() const { return body_; }
  [[nodiscard]] const Session& session() const { return session_; }

  bool session_hears = true, models_arrive = true;

 private:
  struct Delivery {
    std::uint32_t arrives, sequence;
  };
  [[nodiscard]] const ModelUpdate& sent(std::uint32_t sequence) const {
    return *std::find_if(sent_.begin(), sent_.end(),
                         [&](const ModelUpdate& update) { return update.message.sequence == sequence; });
  }
  template <class Message>
  static std::vector<std::uint8_t> payload(const Message& message) {
    std::vector<std::uint8_t> bytes(wire::MessageTraits<Message>::kMaxBytes);
    std::size_t length = 0;
    EXPECT_EQ(wire::serialize(message, bytes, length), Status::ok);
    bytes.resize(length);
    return bytes;
  }
  void deliver(const wire::PackedModel& packed) {
    for (const auto& part : wire::parts_of(*packed.basis, packed.state.basis_id))
      ASSERT_EQ(renderer_->accept_part(payload(part)), Status::ok);
    for (firmware::BasisStore::Event event; renderer_->next_basis_event(event);)
      EXPECT_EQ(event.status, Status::ok);
    firmware::ModelReport report;
    ASSERT_EQ(renderer_->accept(payload(packed.state), report), Status::ok);
  }

  Body body_ = block(kSide);
  Session session_;
  std::unique_ptr<firmware::Renderer> renderer_ =
      std::make_unique<firmware::Renderer>(wire::kSchemaHash, firmware::kCatchUpCortexM4);
  std::deque<ModelUpdate> sent_;
  std::deque<Delivery> under_way_;
  std::uint32_t now_ = 0;
};

// Static stiffness of the point at which a model was sent in contact: of the model itself, outside which all
// is held, and of the whole body.
struct Stiffness {
  double model_N_m = 0, difference_N_m = 0;  // largest eigenvalues
};

Stiffness stiffness_at_contact(const Body& body, const ModelUpdate& update) {
  const wire::ModelContents& m = update.message;
  const auto& corner = body.triangles()[m.contact.triangle];
  std::size_t t = 0;
  while (m.triangle_id.elements[t] != m.contact.triangle) ++t;
  // At rest q = -b1 / a11 u of a mode.
  Eigen::Matrix3d of_model = Eigen::Matrix3d::Zero();
  for (std::size_t mode = 0; mode < m.modes; ++mode) {
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t axis = 0; axis < 3; ++axis)
        w[static_cast<Eigen::Index>(axis)] +=
            static_cast<double>(m.contact.barycentric[c]) *
            static_cast<double>(m.basis_scale.elements[mode]) *
            m.basis.elements[(3u * m.corner.elements[3 * t + c] + axis) * m.modes + mode];
    const float* k = m.coefficient.elements + kCoefficientsPerMode * mode;
    of_model += w * w.transpose() * (-static_cast<double>(k[4]) / static_cast<double>(k[0]));
  }
  const Eigen::SparseMatrix<double> tangent_N_m = -tangent(body, update.state).df_dx_N_m;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(tangent_N_m);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(body.dof_count(), 3);
  for (std::size_t c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis)
      weights(body.dof(corner[c], axis), axis) = static_cast<double>(m.contact.barycentric[c]);
  const Eigen::Matrix3d of_body = weights.transpose() * solver.solve(weights);
  const Eigen::Matrix3d model_N_m = of_model.inverse();
  return {model_N_m.operatorNorm(), (model_N_m - of_body.inverse()).operatorNorm()};
}

// How far the force may change where a model takes over from one from which on the tip has moved by `path_m`
// at `speed_m_s`, pressed in by `depth_m`:
//   - the older one holds everything around it: it is stiffer than the body by `difference` on that path, and
//   in
//     moving its force there (a slip) by as much again of depth / spacing on either side;
//   - it is linear: springs turn by path / spacing, which changes the stiffness by up to twice that
//     (body_surface_test), the force by the integral;
//   - dampers: b / k of the material (4.5 ms) at that speed, and a tick for the motion between the two
//   samples.
double largest_change_N(const Stiffness& stiffness, double path_m, double speed_m_s, double depth_m) {
  constexpr double kMaterial_s = 4.5e-3;
  const double s_m = path_m + speed_m_s * (kMaterial_s + kTick_s);
  return stiffness.difference_N_m * s_m * (1.0 + 2.0 * depth_m / kSpacing_m) +
         stiffness.model_N_m * (s_m * s_m / kSpacing_m + speed_m_s * kTick_s);
}

struct Swaps {
  int in_contact = 0, with_inset = 0, sticking = 0, slipping = 0;
};

// No contact lost from the first touch on; no change of force beyond the bound at any swap in contact.
Swaps check_swaps(Loop& loop, const Path& path, double depth_m) {
  Swaps swaps;
  std::optional<Tick> before;
  std::optional<Stiffness> stiffness;
  double largest_speed_m_s = 0;
  std::vector<double> way_m{0.0};  // since tick 0
  bool touched = false;
  for (const Vec3d& tip_m : path.tip_m) {
    const Tick now = loop.tick(tip_m);
    if (before) {
      const double step_m = norm(now.tip_m - before->tip_m);
      way_m.push_back(way_m.back() + step_m);
      largest_speed_m_s = std::max(largest_speed_m_s, step_m / kTick_s);
    }
    touched |= now.mode != ContactMode::free;
    if (touched) {
      EXPECT_NE(now.mode, ContactMode::free) << now.tick;
    }
    if (now.swap && before && before->used && before->mode != ContactMode::free &&
        loop.newest().message.contact.mode != palpate_Contact_1_0_MODE_FREE) {
      if (!stiffness) stiffness = stiffness_at_contact(loop.body(), loop.newest());
      // What is left of a start inside goes away by pushing the surface out: a motion, too.
      const double pushed_m =
          now.inset_m > 0 ? kPushOut_m_s * kTick_s * (now.tick - before->model_tick) : 0.0;
      const double bound_N =
          largest_change_N(*stiffness, way_m[now.tick] - way_m[before->model_tick] + pushed_m,
                           largest_speed_m_s + (now.inset_m > 0 ? kPushOut_m_s : 0.0), depth_m);
      EXPECT_LE(norm(now.force_N - before->force_N), bound_N) << now.tick;
      ++swaps.in_contact;
      swaps.with_inset += now.inset_m > 0;
      swaps.sticking += now.mode == ContactMode::stick;
      swaps.slipping += now.mode == ContactMode::slip;
    }
    before = now;
  }
  return swaps;
}

SessionConfig with_friction(double mu) {
  SessionConfig config;
  config.friction.elsewhere = {mu, mu};
  return config;
}

constexpr double kDepth_m = 0.002;
constexpr Vec3d kPlace_m{0.0245, 0.0315, 0.0};

Path press() {
  Path path(kPlace_m + Vec3d{0, 0, 5e-4});
  path.hold(80).to(kPlace_m + Vec3d{0, 0, -kDepth_m}, 300);
  return path;
}

TEST(ModelSwap, AStickingContactGoesOn) {
  Loop loop(with_friction(10.0));
  Path path = press();
  path.to(kPlace_m + Vec3d{0.002, 0.001, -kDepth_m}, 300).hold(100);
  const Swaps swaps = check_swaps(loop, path, kDepth_m);
  EXPECT_GT(swaps.sticking, 15);
}

TEST(ModelSwap, ASlippingContactGoesOnOverACell) {
  Loop loop(with_friction(0.3));
  Path path = press();
  path.to(kPlace_m + Vec3d{0.012, 0.004, -kDepth_m}, 800);
  const Swaps swaps = check_swaps(loop, path, kDepth_m);
  EXPECT_GT(swaps.slipping, 15);
}

// The body and the board learn of the tip when it is inside already.
TEST(ModelSwap, WhatIsLeftOfAStartInsideTravelsWithTheModels) {
  Loop loop(with_friction(0.5));
  constexpr double kStart_m = 0.008;
  Path path(kPlace_m + Vec3d{0, 0, -kStart_m});
  path.hold(350).to(kPlace_m + Vec3d{0.003, 0.0, -kStart_m}, 200);
  const Swaps swaps = check_swaps(loop, path, kStart_m);
  EXPECT_GT(swaps.with_inset, 8);
  EXPECT_GT(loop.session().contact().inset_m, 0.0);
}

// No model reaches the board for a while, and the tip is dragged out of the patch. The plane of the contact
// holds it there; the next model that comes knows the surface below it.
TEST(ModelSwap, ATipBeyondThePatchIsPickedUp) {
  for (const double mu : {0.0, 0.3}) {
    Loop loop(with_friction(mu));
    for (const Tick& tick : loop.follow(press())) (void)tick;
    double border_m = 0;
    for (const int node : loop.newest().patch_nodes)
      border_m = std::max(border_m, loop.newest().state.position_m(0, node));
    loop.models_arrive = false;
    const Vec3d start_m = kPlace_m + Vec3d{0, 0, -kDepth_m};
    const double end_x_m = border_m + 0.5 * kLevelOverhang * kSpacing_m;
    Path out(start_m);
    out.to({end_x_m, start_m.y, start_m.z}, 700);
    Tick before{};
    for (const Vec3d& tip_m : out.tip_m) {
      const Tick now = loop.tick(tip_m);
      EXPECT_NE(now.mode, ContactMode::free) << now.tick;
      EXPECT_FALSE(now.swap && tip_m.x > border_m);
      before = now;
    }
    loop.models_arrive = true;
    // A node of the surface whose neighbours are all held presses back with 100 N/m x (1 + 4/2 + 4/3) along
    // the normal; an edge between two of them at its middle with twice that. Neither the border nor the
    // surface behind it presses more, nor is pulled more along (friction, square root of 1 + mu^2), so that
    // the change is at most:
    const double bound_N = 2.0 * 433.0 * kDepth_m * std::sqrt(1.0 + mu * mu);
    bool picked_up = false;
    for (int i = 0; i < 100; ++i) {
      const Tick now = loop.tick(out.tip_m.back());
      EXPECT_NE(now.mode, ContactMode::free) << now.tick;
      if (now.swap) {
        EXPECT_LE(norm(now.force_N - before.force_N), bound_N);
        picked_up = true;
      }
      before = now;
    }
    EXPECT_TRUE(picked_up);
    // From here on it is the body's own force.
    EXPECT_NEAR(norm(before.force_N), norm(loop.session().contact().force_N),
                0.05 * norm(loop.session().contact().force_N));
  }
}

// Host and board learn of the tip when it has rested inside for a while. The body is pushed from no force on;
// the first model comes with what that has led to by then. Let go, the tip comes out.
TEST(FirstModel, ATipInsideFeelsThePushingOutOnlyAndIsLedOut) {
  Loop loop(with_friction(0.5));
  constexpr double kDepth = 0.006;
  const Vec3d inside_m = kPlace_m + Vec3d{0, 0, -kDepth};
  loop.session_hears = false;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(loop.tick(inside_m).force_N, Vec3d{});
  loop.session_hears = true;
  std::optional<std::uint32_t> first_tick;
  const std::uint32_t heard_tick = 100;
  // The body yields to the push under the same force on host and board; a swap may change it as two linear
  // models differ (5 %).
  constexpr double kLargest_N = 1.05 * kPushOut_N;
  double held_N = 0;
  for (int i = 0; i < 500; ++i) {
    const Tick now = loop.tick(inside_m);
    held_N = norm(now.force_N);
    EXPECT_LE(held_N, kLargest_N) << now.tick;
    if (!now.used || first_tick) continue;
    first_tick = now.tick;
    EXPECT_NE(now.mode, ContactMode::free);
    const double drawn_m = kPushOut_m_s * kTick_s * (now.tick - heard_tick);
    // The point gives way against the dampers, too: b / k = 4.5 ms.
    EXPECT_LE(held_N,
              stiffness_at_contact(loop.body(), loop.newest()).model_N_m * (drawn_m + 4.5e-3 * kPushOut_m_s));
  }
  ASSERT_TRUE(first_tick);
  EXPECT_GT(held_N, 0.9 * kPushOut_N);  // as far as that leads

  // A hand that gives way, as in honey: at the surface the last of the force fades away.
  constexpr double kHand_N_s_m = 50.0;
  constexpr int kTicks = 1500;  // 6 mm at 1 N take 300 of them, then 0.1 s to an e-th of the force
  Vec3d tip_m = inside_m, force_N{};
  for (int i = 0; i < kTicks; ++i) {
    tip_m -= force_N * (kTick_s / kHand_N_s_m);
    force_N = loop.tick(tip_m).force_N;
    EXPECT_LE(norm(force_N), kLargest_N) << i;
  }
  EXPECT_EQ(loop.session().contact().inset_m, 0.0);
  constexpr double kFaded_N = 1e-3, kFaded_m = 1e-5;  // e^-7; and what is left of the depth
  EXPECT_LE(norm(force_N), kFaded_N);
  EXPECT_NEAR(tip_m.z, 0.0, kFaded_m);
}

}  // namespace
}  // namespace palpate::host
