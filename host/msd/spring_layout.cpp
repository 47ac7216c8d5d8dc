#include "host/msd/spring_layout.hpp"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

namespace palpate::host {
namespace {

// Shorter bands do not fill the kernels' registers often enough to matter.
constexpr std::size_t kShortestBand = 16;
// A place in a band costs a quarter of a loose spring; a 3x3x3 lattice's space diagonals fill 8 places of 13.
constexpr double kSmallestFill = 0.4;

Spring with_forward_nodes(Spring spring) {
  if (spring.i > spring.j) std::swap(spring.i, spring.j);
  return spring;
}

}  // namespace

SpringLayout make_spring_layout(const Body& body) {
  std::map<std::tuple<int, double, double, double>, std::vector<Spring>> groups;
  for (const Spring& given : body.springs()) {
    const Spring spring = with_forward_nodes(given);
    groups[{spring.j - spring.i, spring.stiffness_N_m, spring.damping_N_s_m, spring.rest_length_m}].push_back(
        spring);
  }
  SpringLayout layout;
  for (auto& [key, springs] : groups) {
    std::sort(springs.begin(), springs.end(), [](const Spring& a, const Spring& b) { return a.i < b.i; });
    // A band holds one spring per node; parallel springs of equal constants stay loose.
    const bool parallel =
        std::adjacent_find(springs.begin(), springs.end(),
                           [](const Spring& a, const Spring& b) { return a.i == b.i; }) != springs.end();
    const auto places = static_cast<std::size_t>(springs.back().i - springs.front().i) + 1;
    if (parallel || springs.size() < kShortestBand ||
        static_cast<double>(springs.size()) < kSmallestFill * static_cast<double>(places)) {
      layout.loose.insert(layout.loose.end(), springs.begin(), springs.end());
      continue;
    }
    SpringBand band;
    band.first = springs.front().i;
    band.offset = std::get<0>(key);
    band.constants = springs.front();
    band.present.assign(places, 0.0);
    for (const Spring& spring : springs) band.present[static_cast<std::size_t>(spring.i - band.first)] = 1.0;
    layout.bands.push_back(std::move(band));
  }
  return layout;
}

}  // namespace palpate::host
