// Linked into each test program that is not declared THREADS (palpate_targets.cmake): what starts a thread
// there, ends with a message, so that ThreadSanitizer sees every test that it can find something in.
//
// But for the thread of a BasisStore: many tests of numbers wait for a basis. What it shares with them is
// tested by basis_store_test, patch_bases_test and session_test, which are declared.
#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string_view>
#include <thread>
#include <typeinfo>
#include <utility>

// libstdc++ starts every std::thread, std::jthread and std::async here; a definition in the program comes
// before the library's.
void std::thread::_M_start_thread(_State_ptr state, void (*depend)()) {
  using Start = void (*)(std::thread*, _State_ptr, void (*)());
  const _State& started = *state;  // of the type of what it is to call
  if (std::string_view(typeid(started).name()).find("7palpate4host10BasisStore") != std::string_view::npos) {
    const auto start = reinterpret_cast<Start>(::dlsym(
        RTLD_NEXT, "_ZNSt6thread15_M_start_threadESt10unique_ptrINS_6_StateESt14default_deleteIS1_EEPFvvE"));
    if (start != nullptr) return start(this, std::move(state), depend);
  }
  std::fprintf(
      stderr,
      "this test starts a thread (%s): declare its program THREADS in CMakeLists.txt, for ThreadSanitizer\n",
      typeid(started).name());
  std::abort();
}
