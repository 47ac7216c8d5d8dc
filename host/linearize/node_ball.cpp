#include "host/linearize/node_ball.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::host {
namespace {

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

double length_m(const Body& body, int a, int b) {
  return (body.rest_position_m().col(a) - body.rest_position_m().col(b)).norm();
}

int nearest_corner(const Body& body, const SurfacePoint& contact) {
  const Eigen::Vector3d contact_m = surface_position_m(body, body.rest_position_m(), contact);
  const Triangle& corners = body.triangles()[at(contact.triangle)];
  const auto distance_m = [&](int node) { return (body.rest_position_m().col(node) - contact_m).norm(); };
  return *std::min_element(corners.begin(), corners.end(),
                           [&](int a, int b) { return distance_m(a) < distance_m(b); });
}

// Nodes in the order of their ways from `centre` (Dijkstra), at most `count`.
std::vector<int> by_way(const Body& body, int centre, int count) {
  using Way = std::pair<double, int>;  // equal ways: the lower number first
  std::priority_queue<Way, std::vector<Way>, std::greater<>> open;
  std::vector<double> shortest_m(at(body.node_count()), std::numeric_limits<double>::infinity());
  std::vector<bool> done(at(body.node_count()), false);
  std::vector<int> nodes;
  shortest_m[at(centre)] = 0.0;
  open.emplace(0.0, centre);
  while (!open.empty() && std::ssize(nodes) < count) {
    const auto [way_m, node] = open.top();
    open.pop();
    if (done[at(node)]) continue;
    done[at(node)] = true;
    nodes.push_back(node);
    for (const int s : body.springs_of(node)) {
      const Spring& spring = body.springs()[at(s)];
      const int next = spring.i == node ? spring.j : spring.i;
      const double next_m = way_m + length_m(body, node, next);
      if (next_m >= shortest_m[at(next)]) continue;
      shortest_m[at(next)] = next_m;
      open.emplace(next_m, next);
    }
  }
  return nodes;
}

}  // namespace

std::vector<int> node_ball(const Body& body, const SurfacePoint& contact, int count) {
  if (count < 3)
    throw std::invalid_argument("the patch has " + std::to_string(count) + " nodes, allowed: at least 3");
  const Triangle& corners = body.triangles()[at(contact.triangle)];
  std::vector<int> nodes(corners.begin(), corners.end());
  for (const int node : by_way(body, nearest_corner(body, contact), count))
    if (std::ssize(nodes) < count && std::find(corners.begin(), corners.end(), node) == corners.end())
      nodes.push_back(node);
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

std::vector<int> triangle_with_neighbour(const Body& body, int triangle) {
  const Triangle& corners = body.triangles()[at(triangle)];
  std::vector<int> nodes(corners.begin(), corners.end());
  const Eigen::Vector3d middle_m = surface_position_m(
      body, body.rest_position_m(), SurfacePoint{triangle, Eigen::Vector3d::Constant(1.0 / 3.0)});
  int nearest = -1;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const int across : body.triangle_neighbours()[at(triangle)])
    for (const int node : body.triangles()[at(across)]) {
      if (std::find(corners.begin(), corners.end(), node) != corners.end()) continue;
      const double distance_m = (body.rest_position_m().col(node) - middle_m).norm();
      if (distance_m < nearest_m) nearest = node;
      nearest_m = std::min(nearest_m, distance_m);
    }
  if (nearest >= 0) nodes.push_back(nearest);
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

std::vector<int> triangles_around(const Body& body, int triangle) {
  const Triangle& corners = body.triangles()[at(triangle)];
  std::vector<int> around;
  for (int t = 0; t < static_cast<int>(body.triangles().size()); ++t) {
    const Triangle& other = body.triangles()[at(t)];
    if (t != triangle &&
        std::find_first_of(other.begin(), other.end(), corners.begin(), corners.end()) != other.end())
      around.push_back(t);
  }
  return around;
}

}  // namespace palpate::host
