// One thread at a time in BLAS.
#pragma once

#include <mutex>

namespace palpate::host {

// To be held around each call of CHOLMOD or BLAS, never twice by a thread. A BLAS built for one thread
// (Debian's openblas-serial) keeps its buffers where all threads see them: two factorizations at a time gave
// wrong factors, and once in some hundred no factor at all.
[[nodiscard]] inline std::unique_lock<std::mutex> blas_lock() {
  static std::mutex mutex;
  return std::unique_lock(mutex);
}

}  // namespace palpate::host
