/* A stiff floor to be felt with a palpate board, in a page of C.
 *
 *   example_wall ADDRESS [SECONDS]      for instance: example_wall serial:/dev/ttyACM0
 *
 * Keep the hand off until it says that outputs are on. */
#include <stdio.h>
#include <stdlib.h>

#include "palpate_device.h"

#define FLOOR_M (-0.005) /* below the middle of the workspace */
#define STIFFNESS_N_M 600.0
#define DAMPING_N_S_M 1.0

/* A spring and a damper below the floor; nothing pulls the tip back to it. */
static double floor_force_N(double z_m, double velocity_m_s) {
  const double depth_m = FLOOR_M - z_m;
  const double force_N = STIFFNESS_N_M * depth_m - DAMPING_N_S_M * velocity_m_s;
  return depth_m > 0.0 && force_N > 0.0 ? force_N : 0.0;
}

static int fail(const char* what, palpate_device* device) {
  fprintf(stderr, "%s: %s\n", what, palpate_device_error(device));
  palpate_device_close(device);
  return 1;
}

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    fprintf(stderr, "usage: example_wall ADDRESS [SECONDS]\n");
    return 2;
  }
  char* end = "";
  const double duration_s = argc == 3 ? strtod(argv[2], &end) : 30.0;
  if (*end != '\0' || !(duration_s > 0.0 && duration_s < 1e6)) {
    fprintf(stderr, "SECONDS is %s: must be a number from 0 to 1e6\n", argv[2]);
    return 2;
  }
  palpate_device* device = NULL;
  if (palpate_device_open(argv[1], &device) != PALPATE_OK) return fail("open", NULL);
  palpate_device_info info;
  palpate_device_get_info(device, &info);
  printf("%s, firmware %s, %.0f states a second, forces up to %.1f N\n", info.board, info.firmware,
         info.state_rate_Hz, info.max_force_N);
  if (palpate_device_enable(device) != PALPATE_OK) return fail("enable", device);
  printf("outputs are on: a floor %.0f mm below the middle\n", -1e3 * FLOOR_M);

  double deepest_m = 0.0, largest_N = 0.0;
  palpate_device_state state;
  unsigned long states = 0;
  const unsigned long all = (unsigned long)(duration_s * info.state_rate_Hz);
  for (; states < all; ++states) {
    const palpate_result result = palpate_device_wait(device, 1.0, &state);
    if (result != PALPATE_OK) return fail("wait", device);
    double force_N[3] = {0.0, 0.0, floor_force_N(state.position_m[2], state.velocity_m_s[2])};
    if (palpate_device_set_force(device, force_N) != PALPATE_OK) return fail("force", device);
    if (FLOOR_M - state.position_m[2] > deepest_m) deepest_m = FLOOR_M - state.position_m[2];
    if (state.force_N[2] > largest_N) largest_N = state.force_N[2];
  }
  printf("%lu states; at most %.2f mm deep, %.2f N\n", states, 1e3 * deepest_m, largest_N);
  palpate_device_close(device);
  return 0;
}
