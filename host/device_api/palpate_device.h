/* A palpate board as a plain haptic device of three degrees of freedom: where is its tip, how fast, push it.
 *
 * For programs and toolkits that compute forces themselves; palpate's own deformable bodies are not involved.
 * The board keeps its safety logic (docs/safety.md): outputs come on only by palpate_device_enable(), forces
 * are limited to info.max_force_N and to info.max_force_step_N a servo tick, fade to zero when none came for
 * info.force_hold_s, and after a second without any the outputs go off.
 *
 *   palpate_device *device;
 *   if (palpate_device_open("serial:/dev/ttyACM0", &device) != PALPATE_OK) puts(palpate_device_error(NULL));
 *   palpate_device_enable(device);
 *   palpate_device_state state;
 *   while (palpate_device_wait(device, 0.1, &state) == PALPATE_OK) {
 *     double force_N[3] = {-200.0 * state.position_m[0], 0.0, 0.0};
 *     palpate_device_set_force(device, force_N);
 *   }
 *   palpate_device_close(device);
 *
 * Positions, velocities and forces are in the device frame (docs/units_and_frames.md): x to the right, y away
 * from the person, z upwards. Forces are those that the tip pushes the hand with. A function may be called
 * from any thread; close() last, when none is inside another. Nothing blocks longer than it says. */
#ifndef PALPATE_DEVICE_H
#define PALPATE_DEVICE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct palpate_device palpate_device;

typedef enum palpate_result {
  PALPATE_OK = 0,
  PALPATE_BAD_ARGUMENT = 1, /* a null pointer, a force that is none or beyond 1e6 N, a time below zero */
  PALPATE_CANNOT_OPEN = 2,  /* no such link, another program has it, or it is too slow */
  PALPATE_NO_BOARD = 3,     /* nothing answers there, or no palpate board does */
  PALPATE_OTHER_SCHEMA = 4, /* a board of other message definitions: flash firmware of this version */
  PALPATE_REFUSED = 5,      /* the board does not do that now; palpate_device_error() says why */
  PALPATE_TIMEOUT = 6,      /* it did not happen in time */
  PALPATE_LOST = 7 /* the link has gone, or the board has been silent for half a second: close, open again */
} palpate_result;

/* Values of palpate_device_state.mode. */
enum {
  PALPATE_MODE_BOOT = 0,
  PALPATE_MODE_IDLE = 1,      /* outputs off */
  PALPATE_MODE_CALIBRATE = 2, /* outputs off */
  PALPATE_MODE_RENDER = 3,    /* outputs on, for a body of palpate's own */
  PALPATE_MODE_FAULT = 4,     /* outputs off until palpate_device_clear_fault() */
  PALPATE_MODE_DIRECT = 5,    /* outputs on, with the forces of this library */
  PALPATE_MODE_SUSPENDED = 6  /* outputs off while the link of a host that renders a body is lost */
};

typedef struct palpate_device_info {
  char board[33];    /* what it calls itself */
  char firmware[33]; /* its version */
  double tick_rate_Hz;
  double state_rate_Hz; /* states that the link brings a second */
  double max_force_N;   /* what is longer is shortened, keeping its direction; beyond 100 N it is a fault */
  double max_force_step_N; /* largest change per servo tick */
  double force_hold_s;     /* as long as a force is held */
} palpate_device_info;

typedef struct palpate_device_state {
  uint32_t tick;          /* of the board: servo ticks since it started, modulo 2^32 */
  double position_m[3];   /* of the tip's centre */
  double velocity_m_s[3]; /* of the tip, estimated by the board from its encoder counts */
  double force_N[3];      /* that is rendered, after all limits; zero while outputs are off */
  int mode;               /* PALPATE_MODE_* */
  unsigned faults;        /* bits of docs/safety.md */
  double age_s;           /* since it arrived here */
} palpate_device_state;

/* Opens the board at an address: "serial:/dev/ttyACM0", "serial:/dev/ttyUSB0,921600", "udp:192.168.1.7:5760".
 * Takes some three seconds at most, and what it takes to find a host's name. `*device` is null but for
 * PALPATE_OK. */
palpate_result palpate_device_open(const char* address, palpate_device** device);
/* Switches the outputs off if this program has them on, and closes. Null is allowed. */
void palpate_device_close(palpate_device* device);

/* In words, what went wrong in the last call that did not return PALPATE_OK: of this device or, with null, of
 * palpate_device_open() in this thread. Valid until the next call. Never null. */
const char* palpate_device_error(const palpate_device* device);

palpate_result palpate_device_get_info(palpate_device* device, palpate_device_info* info);

/* The newest state. Does not wait for another one. */
palpate_result palpate_device_get_state(palpate_device* device, palpate_device_state* state);
/* Waits for a state that no call of this function has returned yet, at most timeout_s: the heartbeat of a
 * haptic loop. PALPATE_TIMEOUT leaves `*state` as it was. One thread. */
palpate_result palpate_device_wait(palpate_device* device, double timeout_s, palpate_device_state* state);

/* Switches the outputs on, in the board's two steps; the force rises from zero within 0.1 s. PALPATE_REFUSED
 * while a fault is there, the tip is outside of its workspace or too fast, and for a board that this version
 * of the library does not know. Takes some milliseconds, three seconds at most. */
palpate_result palpate_device_enable(palpate_device* device);
/* Switches the outputs off. Takes some milliseconds, two seconds at most. */
palpate_result palpate_device_disable(palpate_device* device);
/* Makes the present pose the reference pose: arm in its reference pose, at rest, hands off. PALPATE_REFUSED
 * where it moves. Takes 0.2 s, three seconds at most. */
palpate_result palpate_device_calibrate(palpate_device* device);
/* From fault to idle, when the cause has gone. Takes some milliseconds, two seconds at most. */
palpate_result palpate_device_clear_fault(palpate_device* device);

/* The force from now on, (3,), N. Send it again at least every info.force_hold_s, best after each state. More
 * than one between two states: the last one counts. Waits for the driver 20 ms at most. PALPATE_REFUSED while
 * the outputs are not on for this program: after a fault, or a second without a force, enable them again. */
palpate_result palpate_device_set_force(palpate_device* device, const double force_N[3]);

#ifdef __cplusplus
}
#endif
#endif
