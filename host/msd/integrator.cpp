#include "host/msd/integrator.hpp"

#include "host/msd/implicit_integrator.hpp"
#include "host/msd/semi_implicit_euler.hpp"

namespace palpate::host {

std::unique_ptr<Integrator> make_integrator(Method method, const Body& body) {
  switch (method) {
    case Method::implicit_euler:
      return std::make_unique<ImplicitIntegrator>(body, ImplicitScheme::euler);
    case Method::sdirk2:
      return std::make_unique<ImplicitIntegrator>(body, ImplicitScheme::sdirk2);
    case Method::semi_implicit_euler:
      break;
  }
  return std::make_unique<SemiImplicitEuler>(body);
}

}  // namespace palpate::host
