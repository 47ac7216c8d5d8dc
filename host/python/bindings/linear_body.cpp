#include <Eigen/SparseCore>
#include <array>
#include <cmath>
#include <cstdint>

#include "host/msd/tangent.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/scene.hpp"

namespace palpate::python {
namespace {

// Node positions are rounded: entries that vanish in the exact lattice come out as some 1e-15 of the diagonal
// entries of their row and column. Those below this fraction are left out, to keep the matrices sparse; none
// of a body whose springs differ by less than 1e10 is a real one.
constexpr double kRounding = 1e-13;

// The matrix without entries that are rounding alone, as {data, indices, indptr} of a CSC array.
nb::dict csc(Eigen::SparseMatrix<double> matrix) {
  const Eigen::VectorXd scale = matrix.diagonal().cwiseAbs().cwiseSqrt();
  matrix.prune([&](Eigen::Index row, Eigen::Index column, double value) {
    return std::abs(value) > kRounding * scale[row] * scale[column];
  });
  matrix.makeCompressed();
  const double* data = matrix.valuePtr();
  const std::int32_t* indices = matrix.innerIndexPtr();
  const std::int32_t* indptr = matrix.outerIndexPtr();
  nb::dict result;
  result["data"] = array(std::vector<double>(data, data + matrix.nonZeros()));
  result["indices"] = array(std::vector<std::int32_t>(indices, indices + matrix.nonZeros()));
  result["indptr"] = array(std::vector<std::int32_t>(indptr, indptr + matrix.cols() + 1));
  return result;
}

void add_degrees_of_freedom(nb::dict& result, const host::Body& body) {
  std::vector<double> mass_kg;
  std::vector<std::int32_t> node, axis;
  for (int n = 0; n < body.node_count(); ++n) {
    for (const int a : body.axes()) {
      if (body.dof(n, a) < 0) continue;
      mass_kg.push_back(body.mass_kg(n));
      node.push_back(n);
      axis.push_back(a);
    }
  }
  result["mass_kg"] = array(std::move(mass_kg));
  result["node"] = array(std::move(node));
  result["axis"] = array(std::move(axis));
}

// nodes: of a lattice along x, y and z; none of a mesh, whose spacing is 0.
void add_nodes(nb::dict& result, const host::Body& body) {
  const auto& lattice = body.lattice();
  result["nodes"] = array(lattice ? std::vector<std::int32_t>(lattice->nodes.begin(), lattice->nodes.end())
                                  : std::vector<std::int32_t>{});
  result["spacing_m"] = lattice ? lattice->spacing_m : 0.0;
  result["rest_position_m"] = nodes_by_3(body.rest_position_m());
  std::vector<int> all(static_cast<std::size_t>(body.node_count()));
  for (std::size_t n = 0; n < all.size(); ++n) all[n] = static_cast<int>(n);
  result["node_mass_kg"] = column<double>(all, [&](int n) { return body.mass_kg(n); });
  result["fixed"] = column<std::uint8_t>(all, [&](int n) { return body.fixed(n); }).attr("view")("bool");
  result["triangles"] = columns3<std::int32_t>(body.triangles(), [](const host::Triangle& t) { return t; });
}

void add_springs(nb::dict& result, const std::vector<host::Spring>& springs) {
  std::vector<std::int32_t> ends;
  for (const host::Spring& spring : springs) ends.insert(ends.end(), {spring.i, spring.j});
  result["springs"] = array(std::move(ends), 2);
  result["spring_stiffness_N_m"] =
      column<double>(springs, [](const host::Spring& s) { return s.stiffness_N_m; });
  result["spring_damping_N_s_m"] =
      column<double>(springs, [](const host::Spring& s) { return s.damping_N_s_m; });
}

}  // namespace

nb::dict linear_body(const nb::dict& scene) {
  const host::Body body = read_body(scene);
  host::Tangent tangent;
  {
    const nb::gil_scoped_release no_gil;
    tangent = host::tangent(body, body.rest_state());
  }
  nb::dict result;
  add_degrees_of_freedom(result, body);
  result["stiffness"] = csc(-tangent.df_dx_N_m);
  result["damping"] = csc(-tangent.df_dv_N_s_m);
  add_nodes(result, body);
  add_springs(result, body.springs());
  return result;
}

}  // namespace palpate::python
