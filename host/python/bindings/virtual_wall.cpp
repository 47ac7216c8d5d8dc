#include "host/bench/virtual_wall.hpp"

#include "host/python/bindings/experiments.hpp"

namespace palpate::python {

std::optional<double> stiffest_wall_N_m(const nb::dict& device, double rate_Hz, std::uint32_t delay_ticks,
                                        double count_m, bool is_controlled, double damping_N_s_m,
                                        double duration_s, double most_J) {
  const auto number = [&](const char* key) { return nb::cast<double>(device[key]); };
  const host::bench::WallDevice held{.mass_kg = number("mass_kg"),
                                     .viscosity_N_s_m = number("viscosity_N_s_m"),
                                     .friction_N = number("friction_N"),
                                     .most_force_N = number("most_force_N")};
  const host::bench::WallServo servo{rate_Hz, delay_ticks, count_m, is_controlled};
  const nb::gil_scoped_release no_gil;
  return host::bench::stiffest_wall_N_m(held, servo, damping_N_s_m, duration_s, most_J);
}

}  // namespace palpate::python
