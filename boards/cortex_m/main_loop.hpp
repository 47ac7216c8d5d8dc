#pragma once

namespace palpate::cortex_m {

// The background of an image, beside the servo's interrupt.
template <class App, class Board>
[[noreturn]] void run_background(App& app, Board& board) {
  for (;;) {
    if (app.background_due()) {
      app.background();
    } else {
      board.idle([&app] { return app.background_due(); });
    }
  }
}

}  // namespace palpate::cortex_m
