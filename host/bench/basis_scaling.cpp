// What the modes of a patch cost on larger bodies: cubes with two adjacent faces held, patches of 4 x 4 x 2
// on the middle of the top, in JSON. Arguments: nodes along an edge, 12 if none are given. Each case runs in
// a process of its own, whose memory is told; times are the processor's. update_s: a model at rest on a patch
// whose modes are there.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "host/linearize/hybrid_builder.hpp"
#include "host/linearize/krylov_builder.hpp"
#include "host/msd/lattice.hpp"

namespace {

using namespace palpate::host;

constexpr int kRounds = 20;
constexpr double kTick_s = 1e-3;

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

constexpr double kMiddle_rad_s = 2.0 * std::numbers::pi * 20.0;
constexpr int kNearNodes = 4;

std::unique_ptr<ModelBuilder> builder_of(const std::string& kind, const Body& body) {
  if (kind == "hybrid")
    return std::make_unique<HybridBuilder>(body, PatchSize{}, kNearNodes, std::vector{kMiddle_rad_s},
                                           kTick_s);
  const auto shifts = kind == "krylov, 0 Hz" ? std::vector{0.0} : std::vector{0.0, kMiddle_rad_s};
  return std::make_unique<KrylovBuilder>(body, PatchSize{}, TangentAt::rest, shifts, kTick_s);
}

void measure(int nodes, const std::string& kind) {
  LatticeSpec spec;
  spec.nodes = {nodes, nodes, nodes};
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus, Face::x_minus};
  const Body body = make_lattice(spec);
  const BodyState rest = body.rest_state();
  const auto top = [&](int i) {
    return nearest_surface_point(body, rest.position_m,
                                 rest.position_m.col(body.lattice()->node(i, nodes / 2, nodes - 1)));
  };
  const SurfacePoint here = top(nodes / 2), beside = top(nodes / 2 + 1);
  const auto builder = builder_of(kind, body);
  const double start_s = processor_s();
  (void)builder->build(rest, here, {});
  const double first_s = processor_s() - start_s;
  const LocalModel model = builder->build(rest, beside, {});
  const double patch_s = processor_s() - start_s - first_s;
  std::vector<double> update_s;
  for (int round = 0; round < kRounds; ++round) {
    const double before_s = processor_s();
    (void)builder->build(rest, beside, {});
    update_s.push_back(processor_s() - before_s);
  }
  std::nth_element(update_s.begin(), update_s.begin() + kRounds / 2, update_s.end());
  std::printf(
      "{\"builder\": \"%s\", \"nodes_per_side\": %d, \"degrees_of_freedom\": %d, \"modes\": %d, "
      "\"factor_s\": %.3g, \"patch_s\": "
      "%.3g, \"update_s\": %.3g, \"basis_bytes\": %zu",
      kind.c_str(), nodes, body.dof_count(), static_cast<int>(model.modes()), first_s - patch_s, patch_s,
      update_s[kRounds / 2],
      sizeof(float) * static_cast<std::size_t>(model.modes()) * static_cast<std::size_t>(body.dof_count()));
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<int> sizes;
  for (int i = 1; i < count; ++i) sizes.push_back(std::stoi(arguments[i]));
  if (sizes.empty()) sizes.push_back(12);
  std::printf("[");
  bool first = true;
  for (const int nodes : sizes) {
    for (const char* kind : {"krylov, 0 Hz", "hybrid", "krylov, 0 and 20 Hz"}) {
      std::printf("%s\n ", first ? "" : ",");
      first = false;
      std::fflush(stdout);
      const pid_t child = fork();
      if (child == 0) {
        measure(nodes, kind);
        _exit(0);
      }
      int status = 0;
      rusage used{};
      if (child < 0 || wait4(child, &status, 0, &used) < 0 || status != 0) return 1;
      std::printf(", \"peak_MB\": %ld}", used.ru_maxrss / 1000);
    }
  }
  std::printf("\n]\n");
}
