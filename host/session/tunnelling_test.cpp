// A fast tip neither passes the surface unnoticed nor is caught when it leaves: random shots at a thin slab,
// on the full body and on a local model of all of it, which is closed as well.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "host/linearize/patch_builder.hpp"
#include "host/linearize/patch_selection.hpp"
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

std::vector<int> all_nodes(const Body& body) {
  std::vector<int> all(static_cast<std::size_t>(body.node_count()));
  for (std::size_t n = 0; n < all.size(); ++n) all[n] = static_cast<int>(n);
  return all;
}

class BoardModel {
 public:
  // Of the whole body.
  BoardModel(const Body& body, const BodyState& start, double radius_m)
      : BoardModel(body, start, all_nodes(body), {0.0, 0.0, 0.0}, radius_m) {}
  // Of some nodes around a place.
  BoardModel(const Body& body, const BodyState& start, const std::vector<int>& nodes,
             const Eigen::Vector3d& near_m, double radius_m)
      : law_{.tip_radius_m = static_cast<float>(radius_m)} {
    const LocalModel model = build_subset_model(
        body, start, nodes, nearest_surface_point(body, start.position_m, near_m), kTick_s);
    const SurfaceFriction friction(body, {.elsewhere = {0.5, 0.4}, .regions = {}});
    wire::ModelContents& m = *message_;
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
  // By the model's number; a model of all nodes keeps their order.
  [[nodiscard]] Vec3d position(std::uint32_t node) {
    const Vec3f x = surface_.position(node) + view_.origin_m;
    return {x.x, x.y, x.z};
  }
  [[nodiscard]] const LocalModelView& view() const { return view_; }
  [[nodiscard]] const ContactState<float>& contact() const { return contact_; }
  [[nodiscard]] ContactMode mode() const { return contact_.mode; }
  [[nodiscard]] Vec3d normal() const { return {contact_.normal.x, contact_.normal.y, contact_.normal.z}; }

 private:
  [[nodiscard]] Vec3f local(const Vec3d& x) const {
    return Vec3f{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z)} - view_.origin_m;
  }

  std::unique_ptr<wire::ModelContents> message_ = std::make_unique<wire::ModelContents>();
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

// The board's usual model: the top of 4x4x2 nodes, open at its border. Looked at without the contact's code.
class OpenPatch {
 public:
  static constexpr double kSpeed_m_s = 0.1;  // of the nodes, along each axis
  OpenPatch(const Body& body, unsigned seed, double radius_m)
      : OpenPatch(body, place(seed), seed, radius_m) {}

  struct Triangle {
    std::array<Vec3d, 3> x;
    std::array<bool, 3> open;  // at the border, across the edge opposite to this corner
  };
  [[nodiscard]] std::vector<Triangle> triangles() {
    const LocalModelView& view = board.view();
    std::vector<Triangle> result(view.triangles);
    for (std::size_t t = 0; t < view.triangles; ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        result[t].x[c] = board.position(view.corner[3 * t + c]);
        result[t].open[c] = open_[t][c];
      }
    return result;
  }

  BoardModel board;

 private:
  static Eigen::Vector3d place(unsigned seed) {
    return {0.022 + 0.001 * (seed % 17), 0.022 + 0.001 * (seed % 13), 0.0};
  }
  OpenPatch(const Body& body, const Eigen::Vector3d& near_m, unsigned seed, double radius_m)
      : OpenPatch(body, test::random_state(body, seed, 5e-4, kSpeed_m_s), near_m, radius_m) {}
  OpenPatch(const Body& body, const BodyState& state, const Eigen::Vector3d& near_m, double radius_m)
      : board(body, state,
              select_patch(body, nearest_surface_point(body, state.position_m, near_m), PatchSize{}), near_m,
              radius_m) {
    const LocalModelView& view = board.view();
    open_.assign(view.triangles, {true, true, true});
    for (std::size_t t = 0; t < view.triangles; ++t)
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t other = 0; other < view.triangles; ++other)
          for (std::size_t k = 0; k < 3; ++k)
            if (view.corner[3 * t + (c + 1) % 3] == view.corner[3 * other + (k + 1) % 3] &&
                view.corner[3 * t + c] == view.corner[3 * other + (k + 2) % 3])
              open_[t][(c + 2) % 3] = false;
  }
  std::vector<std::array<bool, 3>> open_;
};

struct Side {
  double distance_m = 0;  // of the tip from the patch; negative behind it
  bool inner = false;     // its closest point is not within kMargin_m of the border
};

constexpr double kMargin_m = 2e-4;

Side side_of(const std::vector<OpenPatch::Triangle>& patch, const Vec3d& tip_m) {
  double least_m = 1.0, square = 0.0;
  Side side;
  Vec3d foot_m{};
  for (const auto& t : patch) {
    const Vec3d place_m = closest_point(tip_m, t.x[0], t.x[1], t.x[2]).position;
    const Vec3d offset_m = tip_m - place_m;
    const double height_m = dot(offset_m, normalized(cross(t.x[1] - t.x[0], t.x[2] - t.x[0])));
    // On an edge several are equally close: the one that the offset stands on most squarely decides.
    const bool equal = norm(offset_m) <= least_m + 1e-9;
    if (norm(offset_m) < least_m - 1e-9 || (equal && std::abs(height_m) > square)) {
      square = std::abs(height_m);
      side.distance_m = std::copysign(norm(offset_m), height_m);
      foot_m = place_m;
    }
    least_m = std::min(least_m, norm(offset_m));
  }
  side.inner = true;
  for (const auto& t : patch)
    for (std::size_t c = 0; c < 3; ++c) {
      if (!t.open[c]) continue;
      const Vec3d& a = t.x[(c + 1) % 3];
      const Vec3d& b = t.x[(c + 2) % 3];
      if (norm(foot_m - closest_point(foot_m, a, b, b).position) < kMargin_m) side.inner = false;
    }
  return side;
}

// A board without a contact looks for one no further than this behind the patch: less than a tenth of its
// diagonal (ModalSurface::bind). Deeper in, the host's next model brings the contact.
constexpr double kLookedAt_m = 0.004;

// At the patch from outside, onto it or over its border; the tip goes on inward. Once it is behind the
// patch's inner part it is in contact, and stays: at once where it came from before that part, from the next
// tick on where it came from beside.
void shoot_at_patch(double radius_m, int shots, unsigned seed) {
  const Body body = test::block(7);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0), both(-1.0, 1.0);
  int met = 0, inward = 0, passed_beside = 0;
  for (int i = 0; i < shots; ++i) {
    OpenPatch patch(body, static_cast<unsigned>(i), radius_m);
    const auto start = patch.triangles();
    const auto& t = start[random() % start.size()];
    Vec3d weight{uniform(random), uniform(random), uniform(random)};
    if (i % 3 == 1) weight.x = 0.0;
    weight = weight * (1.0 / (weight.x + weight.y + weight.z));
    const Vec3d aim_m = t.x[0] * weight.x + t.x[1] * weight.y + t.x[2] * weight.z;
    Vec3d direction{};
    do {
      direction = normalized(Vec3d{both(random), both(random), both(random)});
    } while (direction.z > -0.1);
    const Vec3d step_m = direction * (kSpeed_m_s * kTick_s);
    Vec3d tip_m = aim_m - step_m * (1.0 + uniform(random));
    if (side_of(start, tip_m).distance_m <= radius_m) continue;
    bool touched = false, behind = false;
    for (int tick = 0; tick < 8; ++tick) {
      const Side before = side_of(patch.triangles(), tip_m);
      const bool touches = patch.board.tick(tip_m, tip_m + step_m);
      tip_m += step_m;
      const Side after = side_of(patch.triangles(), tip_m);
      ASSERT_TRUE(is_finite(patch.board.contact().force_N));
      const bool is_behind = after.inner && after.distance_m < radius_m - kResolution_m;
      const bool from_before = before.inner && before.distance_m > radius_m;
      const bool from_beside = behind && before.distance_m > -kLookedAt_m;
      if (is_behind && (touched || from_before || from_beside)) {
        ASSERT_TRUE(touches) << "shot " << i << " tick " << tick << " depth " << after.distance_m;
        ++inward;
      }
      passed_beside += is_behind && !touched && from_beside;
      met += touches && !touched;
      touched = touches;
      behind = is_behind;
    }
  }
  EXPECT_GT(met, shots / 2);
  EXPECT_GT(inward, shots);
  EXPECT_GT(passed_beside, 10);
}

TEST(Tunnelling, NoShotPassesThePatchOfABody) {
  shoot_at_patch(0.0, 1000, 7);
  shoot_at_patch(0.003, 300, 8);
}

// From behind the patch, as where a tip starts inside: out through it with no more force than the
// pushing-out's, and met again when it comes back.
TEST(Tunnelling, AShotFromBehindThePatchLeavesAndIsMetWhenItReturns) {
  const Body body = test::block(7);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(0.0, 1.0), both(-1.0, 1.0);
  constexpr int kShots = 500;
  int left = 0, returned = 0;
  for (int i = 0; i < kShots; ++i) {
    OpenPatch patch(body, static_cast<unsigned>(i), 0.0);
    const auto start = patch.triangles();
    const auto& t = start[random() % start.size()];
    const Vec3d aim_m = (t.x[0] + t.x[1] + t.x[2]) * (1.0 / 3.0);
    // Steeper than any triangle of the patch leans and any node moves: it goes outward everywhere.
    Vec3d direction{};
    do {
      direction = normalized(Vec3d{both(random), both(random), both(random)});
    } while (direction.z < 0.5);
    const Vec3d step_m = direction * (kSpeed_m_s * kTick_s);
    Vec3d tip_m = aim_m - step_m * (0.2 + uniform(random));
    const Side begin = side_of(start, tip_m);
    if (!begin.inner || begin.distance_m > 0) continue;
    bool out = false;
    for (int tick = 0; tick < 4 && !out; ++tick) {
      (void)patch.board.tick(tip_m, tip_m + step_m);
      tip_m += step_m;
      const ContactState<float>& contact = patch.board.contact();
      EXPECT_LE(-dot(contact.normal, contact.force_N), static_cast<float>(kPushOut_N)) << i;
      out = contact.mode == ContactMode::free && contact.outside;
    }
    const Side outside = side_of(patch.triangles(), tip_m);
    if (!outside.inner) continue;
    EXPECT_TRUE(out) << i << " " << outside.distance_m;
    ++left;
    bool touched = false;
    for (int tick = 0; tick < 4 && !touched; ++tick) {
      touched = patch.board.tick(tip_m, tip_m - step_m);
      tip_m -= step_m;
      const Side side = side_of(patch.triangles(), tip_m);
      if (side.inner && side.distance_m < -kResolution_m) {
        ASSERT_TRUE(touched) << i << " " << tick;
      }
    }
    returned += touched;
  }
  EXPECT_GT(left, kShots / 3);
  EXPECT_GT(returned, kShots / 3);
}

}  // namespace
}  // namespace palpate::host
