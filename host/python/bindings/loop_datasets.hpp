// Ticks and updates of a closed loop as the datasets of palpate.record_layout.
#pragma once

#include <nanobind/nanobind.h>

#include <vector>

#include "host/link/medium.hpp"
#include "host/session/loop_record.hpp"

namespace palpate::python {

namespace nb = nanobind;

void add_ticks(nb::dict& result, const std::vector<host::LoopTick>& ticks);
void add_counters(nb::dict& result, const host::LoopCounters& counters);
nb::dict medium_counters(const link::MediumCounters& counters);
nb::dict trouble_counters(const host::TroubleCounters& counters);
void add_updates(nb::dict& result, const std::vector<host::UpdateRecord>& updates);

}  // namespace palpate::python
