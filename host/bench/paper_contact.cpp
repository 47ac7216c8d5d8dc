// Prints as JSON what separates the paper's contact from the default one (docs/decisions/paper_contact.md):
// the paper's 4x4x2 patch on top of a 6x6x6 body of its material (1 g, 100 N/m, cells of 1 cm, damping ratio
// 1), linearized at rest.
#include <cstdio>
#include <vector>

#include "host/msd/lattice.hpp"
#include "host/reference/contact_study.hpp"

namespace {

using namespace palpate;
using namespace palpate::host;
using namespace palpate::host::paper;

constexpr Vec3d kStart_m{0.0235, 0.0215, 0.05};  // on the top, inside a triangle
constexpr double kDepth_m = 0.002;
constexpr double kApproach_m_s = 0.2;

LinearPatch reference_patch() {
  LatticeSpec spec;
  spec.nodes = {6, 6, 6};
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  const Body body = make_lattice(spec);
  const BodyState rest = body.rest_state();
  return linear_patch(body, rest,
                      nearest_surface_point(body, rest.position_m, {kStart_m.x, kStart_m.y, kStart_m.z}),
                      {4, 4, 2});
}

// Prints numbers under names, and lists of objects, in the order they are given.
class Json {
 public:
  void open(const char* name, char bracket) {
    key(name);
    std::putchar(bracket);
    first_ = true;
  }
  void close(char bracket) {
    std::putchar(bracket);
    first_ = false;
  }
  void number(const char* name, double value) {
    key(name);
    std::printf("%.6g", value);
  }
  void text(const char* name, const char* value) {
    key(name);
    std::printf("\"%s\"", value);
  }

 private:
  void key(const char* name) {
    if (!first_) std::fputs(", ", stdout);
    first_ = false;
    if (name != nullptr) std::printf("\"%s\": ", name);
  }
  bool first_ = true;
};

void report_convergence(Json& json, const LinearPatch& patch) {
  json.open("convergence", '[');
  for (const double phase_s : {0.04, 0.08}) {
    for (const FrictionCase& friction : friction_cases()) {
      PressAndDrag motion;
      motion.start_m = kStart_m;
      motion.phase_s = phase_s;
      const Convergence c = measure_convergence(patch, friction, motion, {1, 2, 4, 8, 16, 32});
      json.open(nullptr, '{');
      json.text("friction", friction.name.c_str());
      json.number("phase_s", phase_s);
      json.number("force_N", c.force_N);
      json.open("rows", '[');
      for (const ConvergenceRow& row : c.rows) {
        json.open(nullptr, '{');
        json.number("steps_per_ms", row.steps_per_ms);
        json.number("default_N", row.default_N);
        json.number("default_normal_N", row.default_normal_N);
        json.number("default_tangential_N", row.default_tangential_N);
        if (row.paper_N >= 0) json.number("paper_N", row.paper_N);
        json.number("default_to_carried_N", row.default_to_carried_N);
        json.number("default_to_held_N", row.default_to_held_N);
        json.close('}');
      }
      json.close(']');
      json.close('}');
    }
  }
  json.close(']');
}

void report_approach(Json& json, const LinearPatch& patch) {
  json.open("approach", '[');
  for (const int steps : {4, 16, 64}) {
    const ApproachRow row = measure_approach(patch, kStart_m, kApproach_m_s, steps);
    json.open(nullptr, '{');
    json.number("steps_per_ms", steps);
    json.number("speed_m_s", kApproach_m_s);
    json.number("default_N_s", row.default_N_s);
    json.number("equation_15_N_s", row.equation_15_N_s);
    json.number("momentum_N_s", row.momentum_N_s);
    json.number("omitted_N_s", row.omitted_N_s);
    json.close('}');
  }
  json.close(']');
}

void report_mass_ratio(Json& json, const LinearPatch& patch) {
  json.open("mass_ratio", '[');
  for (const double ratio : {0.25, 0.5, 1.0, 2.0, 4.0, 8.0}) {
    const MassRatioRow row = measure_mass_ratio(patch, kStart_m, kDepth_m, ratio);
    json.open(nullptr, '{');
    json.number("mass_ratio", ratio);
    json.number("exact_N", row.exact_N);
    json.number("default_N", row.default_N);
    json.number("paper_N", row.paper_N);
    json.number("predicted_N", row.predicted_N);
    json.close('}');
  }
  json.close(']');
}

void report_lift(Json& json, const LinearPatch& patch) {
  json.open("lift", '[');
  for (const int steps : {4, 16, 64, 256}) {
    const LiftRow held = measure_lift(patch, kStart_m, PaperPointVelocity::held, steps);
    const LiftRow carried = measure_lift(patch, kStart_m, PaperPointVelocity::carried, steps);
    json.open(nullptr, '{');
    json.number("steps_per_ms", steps);
    json.number("held_contact_share", held.contact_share);
    json.number("held_force_share", held.force_share);
    json.number("carried_contact_share", carried.contact_share);
    json.number("carried_force_share", carried.force_share);
    json.close('}');
  }
  json.close(']');
}

}  // namespace

int main() {
  const LinearPatch patch = reference_patch();
  Json json;
  json.open(nullptr, '{');
  json.number("largest_stable_step_s", largest_stable_step_s(patch));
  report_convergence(json, patch);
  report_approach(json, patch);
  report_mass_ratio(json, patch);
  report_lift(json, patch);
  json.close('}');
  std::putchar('\n');
  return 0;
}
