#include "host/bench/model_cost.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <stdexcept>

namespace palpate::host::bench {
namespace {

constexpr Eigen::Index kKernelSize = 128;

template <typename Work>
double seconds_of(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

ModelCost measure_model_cost(ModelBuilder& builder, const std::vector<TouchedState>& states,
                             std::uint32_t rounds) {
  if (states.empty()) throw std::invalid_argument("model cost: the tip never touches the body");
  if (rounds == 0) throw std::invalid_argument("model cost: rounds = 0: must be at least 1");
  const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(kKernelSize, kKernelSize, 0.5);
  Eigen::MatrixXd product(kKernelSize, kKernelSize);
  ModelCost cost;
  std::vector<double> kernel_s, model_s;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double first_s = seconds_of([&] { (void)builder.build(states[i].state, states[i].contact, {}); });
    if (i == 0) cost.first_s = first_s;
  }
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (const TouchedState& touched : states) {
      kernel_s.push_back(seconds_of([&] { product.noalias() = a * a; }));
      model_s.push_back(seconds_of([&] { (void)builder.build(touched.state, touched.contact, {}); }));
    }
  }
  cost.kernel_s = median(kernel_s);
  cost.model_s = median(model_s);
  return cost;
}

}  // namespace palpate::host::bench
