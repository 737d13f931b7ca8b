/* The whole controller: session, orders, latch, reflexes, wheels, telemetry. It knows no hardware
 * and no clock: the board hands in bytes, inputs and the time (us, wraps), and takes outputs and
 * bytes. All differences of time are modulo 2^32, good for 35 minutes. */
#ifndef CORE_CONTROLLER_H
#define CORE_CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

#include "core/board_types.h"
#include "core/outbox.h"
#include "core/reflex.h"
#include "core/wheel.h"
#include "wire/frame.h"

struct identity {
    uint8_t board;  /* WIRE_BOARD_* */
    uint16_t boot;  /* number of starts: tells the host that the counts began again */
    uint32_t build; /* hash of the sources */
};

struct timers {
    uint32_t wheels_us; /* when each message was last sent */
    uint32_t contacts_us;
    uint32_t power_us;
    uint32_t status_us;
    uint8_t contacts; /* what was last sent */
    uint8_t state;
    uint8_t stop_reason;
    bool all_due; /* a session has just opened: say everything once */
};

struct controller {
    struct frame_decoder decoder;
    struct outbox outbox;
    struct wheel left;
    struct wheel right;
    struct reflexes reflexes;
    struct inputs in; /* as of the last step */
    struct identity identity;
    struct timers timers;
    uint16_t session; /* 0: none is open, everything is denied */
    uint8_t stop_reason;
    uint16_t latch; /* number of the last stop */
    bool has_order;
    uint32_t order_us; /* when it came, and for how long it holds */
    uint32_t order_valid_us;
    uint8_t brush_pct;
    uint8_t fan_pct;
    uint32_t heard_us; /* last valid frame of the session */
    uint32_t step_us;
    uint32_t control_us;
    uint16_t refused; /* counters wrap */
    uint16_t expired;
    uint8_t out_seq;
};

/* Start latched with reason RESET and without a session. */
void controller_start(struct controller *c, const struct identity *identity,
                      const struct inputs *in, uint32_t now_us);

/* One byte from the line. */
void controller_receive(struct controller *c, uint8_t byte, uint32_t now_us);

/* Once a millisecond, or as often as the board can (at least every CONTROL_PERIOD_US). */
void controller_step(struct controller *c, const struct inputs *in, uint32_t now_us,
                     struct outputs *out);

/* Latch a stop: wheels brake and brush and fan end with this call. The first reason stays. */
void controller_stop(struct controller *c, uint8_t reason);

/* WIRE_STATE_* */
uint8_t controller_state(const struct controller *c);

#endif
