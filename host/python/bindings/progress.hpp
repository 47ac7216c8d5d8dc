// Calls a Python progress function from a computation that runs without the GIL.
#pragma once

#include <nanobind/nanobind.h>

#include "host/session/simulation.hpp"

namespace palpate::python {

inline host::Progress with_gil(const nanobind::callable& progress) {
  return [&progress](std::uint32_t done, std::uint32_t total) {
    const nanobind::gil_scoped_acquire gil;
    return nanobind::cast<bool>(progress(done, total));
  };
}

}  // namespace palpate::python
