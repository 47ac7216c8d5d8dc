#pragma once

namespace palpate::cortex_m {

// Background: waits for the next interrupt unless is_work(). With interrupts held back between the question
// and WFI, none is slept through: a pending one ends WFI also while it is held back.
template <class IsWork>
void idle_unless(IsWork is_work) {
  asm volatile("cpsid i" ::: "memory");
  if (!is_work()) asm volatile("dsb\n wfi" ::: "memory");
  asm volatile("cpsie i\n isb" ::: "memory");
}

}  // namespace palpate::cortex_m
