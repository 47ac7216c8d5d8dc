// A fast tip neither passes the surface unnoticed nor is caught when it leaves: random shots at a thin slab,
// on the full body and on a local model of all of it, which is closed as well.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "host/linearize/patch_builder.hpp"
#include "host/msd/vectors.hpp"
#include "host/session/model_message.hpp"
#include "host/session/test_contact.hpp"
#include "shared/model/modal_surface.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::host {
namespace {

constexpr double kSpeed_m_s = 5.0;  // of the tip, relative to the device
// At most, along each axis; of the body. In the ticks of a shot it stays within what a local model may move.
constexpr double kBodySpeed_m_s = 1.0;
constexpr double kSpacing_m = 0.01;

// One cell thick, so that the tip is never far from the face behind; nothing holds it.
Body slab() {
  LatticeSpec spec = test::free_spec(2, 1.0);
  spec.nodes = {4, 4, 2};
  spec.spacing_m = kSpacing_m;
  return make_lattice(spec);
}

// The surfaces under test, with one tick of contact as the hand would have it.
class FullBody {
 public:
  FullBody(const Body& body, const BodyState& start, double radius_m)
      : surface(body, start, 1e-4, SurfaceKind::smooth, {}, {.elsewhere = {0.5, 0.4}, .regions = {}}),
        law_{.tip_radius_m = radius_m} {}
  // Returns whether the tip touched.
  bool tick(const Vec3d& from_m, const Vec3d& to_m) {
    const int steps = steps_per_tick(surface.step_s());
    bool touched = false;
    Vec3d tip_m = from_m;
    for (int i = 1; i <= steps; ++i) {
      const Vec3d next_m = from_m + (to_m - from_m) * (static_cast<double>(i) / steps);
      step_contact(surface, contact, law_, tip_m, next_m);
      tip_m = next_m;
      if (contact.mode != ContactMode::free && !touched) {
        touched = true;
        normal_ = contact.normal;
      }
    }
    return touched;
  }
  [[nodiscard]] Vec3d position(std::uint32_t node) { return surface.position(node); }
  [[nodiscard]] ContactMode mode() const { return contact.mode; }
  [[nodiscard]] Vec3d normal() const { return normal_; }  // where it touched first in a tick

  BodySurface surface;
  ContactState<double> contact{};

 private:
  Vec3d normal_{};
  ContactLaw<double> law_;
};

class BoardModel {
 public:
  BoardModel(const Body& body, const BodyState& start, double radius_m)
      : law_{.tip_radius_m = static_cast<float>(radius_m)} {
    std::vector<int> all(static_cast<std::size_t>(body.node_count()));
    for (std::size_t n = 0; n < all.size(); ++n) all[n] = static_cast<int>(n);
    const LocalModel model = build_subset_model(
        body, start, all, nearest_surface_point(body, start.position_m, {0.0, 0.0, 0.0}), kTick_s);
    const SurfaceFriction friction(body, {.elsewhere = {0.5, 0.4}, .regions = {}});
    palpate_LocalModel_1_0& m = *message_;
    pack_model(model, {1, 0, 200}, {.tip_radius_m = radius_m}, SurfaceKind::smooth, friction, {}, m);
    view_ = wire::view_of(m);
    for (std::size_t i = 0; i < m.modes; ++i) {
      state_.q[i] = m.state_q.elements[i];
      state_.p[i] = m.state_p.elements[i];
    }
    surface_.bind(view_, state_);
  }
  bool tick(const Vec3d& from_m, const Vec3d& to_m) {
    step_contact(surface_, contact_, law_, local(from_m), local(to_m));
    return contact_.mode != ContactMode::free;
  }
  // Nodes keep their order: the model has them all.
  [[nodiscard]] Vec3d position(std::uint32_t node) {
    const Vec3f x = surface_.position(node) + view_.origin_m;
    return {x.x, x.y, x.z};
  }
  [[nodiscard]] ContactMode mode() const { return contact_.mode; }
  [[nodiscard]] Vec3d normal() const { return {contact_.normal.x, contact_.normal.y, contact_.normal.z}; }

 private:
  [[nodiscard]] Vec3f local(const Vec3d& x) const {
    return Vec3f{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z)} - view_.origin_m;
  }

  std::unique_ptr<palpate_LocalModel_1_0> message_ = std::make_unique<palpate_LocalModel_1_0>();
  LocalModelView view_{};
  ModalState state_{};
  ModalSurface surface_{};
  ContactState<float> contact_{};
  ContactLaw<float> law_;
};

// How often the closed surface goes around a point: 1 inside, 0 outside, by the solid angles of its triangles
// (van Oosterom and Strackee, 1983). Independent of distances and normals.
template <class Surface>
double winding(const Body& body, Surface& surface, const Vec3d& point) {
  double sum = 0.0;
  for (const Triangle& corner : body.triangles()) {
    Vec3d r[3];
    double length[3];
    for (std::size_t c = 0; c < 3; ++c) {
      r[c] = surface.position(static_cast<std::uint32_t>(corner[c])) - point;
      length[c] = norm(r[c]);
    }
    const double numerator = dot(r[0], cross(r[1], r[2]));
    const double denominator = length[0] * length[1] * length[2] + dot(r[0], r[1]) * length[2] +
                               dot(r[1], r[2]) * length[0] + dot(r[2], r[0]) * length[1];
    sum += 2.0 * std::atan2(numerator, denominator);
  }
  return sum / (4.0 * std::numbers::pi);
}

template <class Surface>
double distance_m(const Body& body, Surface& surface, const Vec3d& point) {
  double least = 1.0;
  for (const Triangle& corner : body.triangles()) {
    Vec3d x[3];
    for (std::size_t c = 0; c < 3; ++c) x[c] = surface.position(static_cast<std::uint32_t>(corner[c]));
    least = std::min(least, norm(point - closest_point(point, x[0], x[1], x[2]).position));
  }
  return least;
}

// A place on the surface: within a triangle, on an edge, or on a node. A direction into the body there. A
// body that drifts.
struct Shot {
  Vec3d start_m{}, step_m{};  // of the tip, per tick
  Vec3d direction{};
  BodyState body;
};

class Shots {
 public:
  explicit Shots(const Body& body, unsigned seed) : body_(body), random_(seed) {}

  Shot next() {
    const auto& triangles = body_.triangles();
    const Triangle& corner = triangles[random_() % triangles.size()];
    Vec3d x[3];
    for (std::size_t c = 0; c < 3; ++c) x[c] = from_eigen(body_.rest_position_m().col(corner[c]));
    Vec3d weight{uniform_(random_), uniform_(random_), uniform_(random_)};
    const auto kind = random_() % 3;
    if (kind >= 1) weight.x = 0.0;
    if (kind == 2) weight.y = 0.0;
    weight = weight * (1.0 / (weight.x + weight.y + weight.z));
    const Vec3d target = x[0] * weight.x + x[1] * weight.y + x[2] * weight.z;
    const Vec3d normal = normalized(cross(x[1] - x[0], x[2] - x[0]));
    Shot shot;
    do {
      shot.direction = normalized(vector());
    } while (dot(shot.direction, normal) > -0.05);
    shot.step_m = shot.direction * (kSpeed_m_s * kTick_s);
    shot.body = body_.rest_state();
    const Vec3d drift_m_s = vector() * kBodySpeed_m_s;
    shot.body.velocity_m_s.colwise() = to_eigen(drift_m_s);
    // Meets the moving target in the middle of a tick, a tick or two from now.
    const double ticks = 1.0 + uniform_(random_);
    shot.start_m = target + (drift_m_s * kTick_s - shot.step_m) * ticks;
    return shot;
  }

 private:
  Vec3d vector() { return {signed_(random_), signed_(random_), signed_(random_)}; }

  const Body& body_;
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{0.05, 1.0}, signed_{-1.0, 1.0};
};

// Where it passes the surface is known to a 256th of a tick's motion; both move.
constexpr double kResolution_m = 2.0 * (kSpeed_m_s + 2.0 * kBodySpeed_m_s) * kTick_s / 256.0;

template <class Surface>
void shoot(double radius_m, int shots, unsigned seed) {
  const Body body = slab();
  Shots source(body, seed);
  int met = 0;
  for (int i = 0; i < shots; ++i) {
    const Shot shot = source.next();
    Surface surface(body, shot.body, radius_m);
    Vec3d tip = shot.start_m;
    bool started_outside = winding(body, surface, tip) < 0.5 && distance_m(body, surface, tip) > radius_m;
    if (!started_outside) continue;
    constexpr int kTicks = 12;
    bool touched = false;
    for (int tick = 0; tick < kTicks && !touched; ++tick) {
      touched = surface.tick(tip, tip + shot.step_m);
      tip += shot.step_m;
      if (touched) break;
      const bool inside = winding(body, surface, tip) > 0.5 && distance_m(body, surface, tip) > kResolution_m;
      ASSERT_FALSE(inside) << "shot " << i << " tick " << tick << " depth " << distance_m(body, surface, tip);
    }
    // Shots at an edge or a node from aside may pass by.
    if (!touched) continue;
    ++met;
    // On the side from which it came. The normal is smooth: at a corner of three faces it is up to
    // asin(sqrt(2/3)) off that of the face.
    const Vec3d relative = shot.direction * kSpeed_m_s - from_eigen(shot.body.velocity_m_s.col(0));
    EXPECT_LT(dot(surface.normal(), normalized(relative)), 0.8165) << "shot " << i;
  }
  EXPECT_GT(met, shots * 6 / 10);
}

TEST(Tunnelling, NoShotEndsInsideTheFullBody) {
  shoot<FullBody>(0.0, 3000, 1);
}
TEST(Tunnelling, NoShotEndsInsideTheLocalModel) {
  shoot<BoardModel>(0.0, 1000, 2);
}
TEST(Tunnelling, NorASphere) {
  shoot<FullBody>(0.003, 1000, 3);
  shoot<BoardModel>(0.003, 300, 4);
}

// From rest on the surface the tip leaves at full speed the way it came.
template <class Surface>
void leave(double radius_m, int shots, unsigned seed) {
  const Body body = slab();
  Shots source(body, seed);
  int left = 0;
  for (int i = 0; i < shots; ++i) {
    const Shot shot = source.next();
    Surface surface(body, shot.body, radius_m);
    Vec3d tip = shot.start_m;
    if (winding(body, surface, tip) > 0.5 || distance_m(body, surface, tip) <= radius_m) continue;
    bool touched = false;
    for (int tick = 0; tick < 12 && !touched; ++tick) {
      touched = surface.tick(tip, tip + shot.step_m);
      tip += shot.step_m;
    }
    if (!touched) continue;
    const Vec3d outward = normalized(surface.normal());
    // The surface follows a tick or two, as far as it was pushed in.
    constexpr int kRelease = 4, kWatch = 12;
    for (int tick = 0; tick < kWatch; ++tick) {
      const Vec3d next = tip + outward * (kSpeed_m_s * kTick_s);
      (void)surface.tick(tip, next);
      tip = next;
      if (tick >= kRelease) {
        ASSERT_EQ(surface.mode(), ContactMode::free) << "shot " << i << " tick " << tick;
      }
    }
    ++left;
  }
  EXPECT_GT(left, shots / 2);
}

TEST(Tunnelling, ATipThatLeavesTheFullBodyIsReleased) {
  leave<FullBody>(0.0, 1000, 5);
}
TEST(Tunnelling, ATipThatLeavesTheLocalModelIsReleased) {
  leave<BoardModel>(0.0, 300, 6);
}

}  // namespace
}  // namespace palpate::host
