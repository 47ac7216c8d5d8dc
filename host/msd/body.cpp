#include "host/msd/body.hpp"

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>

namespace palpate::host {
namespace {

constexpr std::array<int, 3> kAxes3d{0, 1, 2};
constexpr std::array<int, 2> kAxes2d{0, 2};

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

[[noreturn]] void refuse(const std::string& what, std::size_t index, const std::string& value,
                         const std::string& allowed) {
  throw std::invalid_argument(what + "[" + std::to_string(index) + "] is " + value + ", allowed: " + allowed);
}

void validate_nodes(const BodyDescription& body) {
  const std::size_t count = body.mass_kg.size();
  if (count == 0) throw std::invalid_argument("a body needs at least one node");
  if (at(static_cast<int>(body.rest_position_m.cols())) != count || body.fixed.size() != count)
    throw std::invalid_argument("mass_kg has " + std::to_string(count) + " entries, rest_position_m " +
                                std::to_string(body.rest_position_m.cols()) + " columns, fixed " +
                                std::to_string(body.fixed.size()) + " entries: they must be equal");
  for (std::size_t n = 0; n < count; ++n)
    if (!(body.mass_kg[n] > 0) || !std::isfinite(body.mass_kg[n]))
      refuse("mass_kg", n, std::to_string(body.mass_kg[n]), "positive and finite");
  if (!body.rest_position_m.allFinite())
    throw std::invalid_argument("rest_position_m holds a number that is not finite");
  if (!is_finite(body.gravity_m_s2)) throw std::invalid_argument("gravity_m_s2 is not finite");
  if (body.planar && body.gravity_m_s2.y != 0)
    throw std::invalid_argument("gravity_m_s2.y is " + std::to_string(body.gravity_m_s2.y) +
                                ", allowed: 0 for a planar body");
}

void validate_springs(const BodyDescription& body) {
  const int count = static_cast<int>(body.mass_kg.size());
  for (std::size_t s = 0; s < body.springs.size(); ++s) {
    const Spring& spring = body.springs[s];
    if (spring.i < 0 || spring.j < 0 || spring.i >= count || spring.j >= count || spring.i == spring.j)
      refuse("springs", s, "between nodes " + std::to_string(spring.i) + " and " + std::to_string(spring.j),
             "two different nodes from 0 to " + std::to_string(count - 1));
    if (!(spring.stiffness_N_m > 0) || !std::isfinite(spring.stiffness_N_m))
      refuse("springs.stiffness_N_m", s, std::to_string(spring.stiffness_N_m), "positive and finite");
    if (!(spring.damping_N_s_m >= 0) || !std::isfinite(spring.damping_N_s_m))
      refuse("springs.damping_N_s_m", s, std::to_string(spring.damping_N_s_m), "zero or positive, finite");
    if (!(spring.rest_length_m >= 0) || !std::isfinite(spring.rest_length_m))
      refuse("springs.rest_length_m", s, std::to_string(spring.rest_length_m), "zero or positive, finite");
  }
}

// Pairs every directed edge a -> b of a triangle with the triangle that runs through b -> a.
std::vector<std::array<int, 3>> pair_edges(const std::vector<Triangle>& triangles, int node_count) {
  const auto key = [](int from, int to) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(from)) << 32U) |
           static_cast<std::uint32_t>(to);
  };
  std::unordered_map<std::uint64_t, int> triangle_of_edge;
  triangle_of_edge.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t e = 0; e < 3; ++e) {
      const int from = triangles[t][e];
      const int to = triangles[t][(e + 1) % 3];
      if (from < 0 || from >= node_count || from == to)
        refuse("triangles", t, "with corner " + std::to_string(from),
               "three different nodes from 0 to " + std::to_string(node_count - 1));
      if (!triangle_of_edge.emplace(key(from, to), static_cast<int>(t)).second)
        refuse("triangles", t,
               "the second to run from node " + std::to_string(from) + " to " + std::to_string(to),
               "each directed edge in one triangle (consistent orientation)");
    }
  }
  std::vector<std::array<int, 3>> neighbours(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t e = 0; e < 3; ++e) {
      const auto across = triangle_of_edge.find(key(triangles[t][(e + 1) % 3], triangles[t][e]));
      if (across == triangle_of_edge.end())
        refuse("triangles", t, "without a neighbour across edge " + std::to_string(e), "a closed surface");
      neighbours[t][e] = across->second;
    }
  }
  return neighbours;
}

}  // namespace

Body::Body(BodyDescription description) : description_(std::move(description)) {
  validate_nodes(description_);
  validate_springs(description_);
  neighbours_ = pair_edges(description_.triangles, node_count());

  spring_start_.assign(at(node_count()) + 1, 0);
  for (const Spring& spring : springs()) {
    ++spring_start_[at(spring.i) + 1];
    ++spring_start_[at(spring.j) + 1];
  }
  for (std::size_t n = 0; n < at(node_count()); ++n) spring_start_[n + 1] += spring_start_[n];
  spring_of_.resize(2 * springs().size());
  std::vector<int> next(spring_start_.begin(), spring_start_.end() - 1);
  for (std::size_t s = 0; s < springs().size(); ++s)
    for (const int end : {springs()[s].i, springs()[s].j})
      spring_of_[at(next[at(end)]++)] = static_cast<int>(s);

  dof_.assign(3 * at(node_count()), -1);
  for (int node = 0; node < node_count(); ++node) {
    if (fixed(node)) continue;
    for (const int axis : axes()) dof_[3 * at(node) + at(axis)] = dof_count_++;
  }
}

std::span<const int> Body::springs_of(int node) const {
  const auto begin = spring_start_[at(node)];
  return {spring_of_.data() + begin, at(spring_start_[at(node) + 1] - begin)};
}

std::span<const int> Body::axes() const {
  return planar() ? std::span<const int>(kAxes2d) : std::span<const int>(kAxes3d);
}

BodyState Body::rest_state() const {
  return {description_.rest_position_m, Eigen::Matrix3Xd::Zero(3, node_count())};
}

}  // namespace palpate::host
