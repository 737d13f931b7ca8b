/* What fuzzer and line trials share: a controller on a bench, and what must hold at any time. */
#ifndef FUZZ_BENCH_H
#define FUZZ_BENCH_H

#include <stdio.h>
#include <stdlib.h>

#include "core/controller.h"
#include "wire/crc32.h"

#define MUST(condition)                                                                     \
    do {                                                                                    \
        if (!(condition)) {                                                                 \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                 \
            abort();                                                                        \
        }                                                                                   \
    } while (0)

static inline void bench_start(struct controller *c)
{
    const struct identity identity = {.board = WIRE_BOARD_HOST, .boot = 1, .build = 1};
    const struct inputs in = {.battery_mv = 16000};
    controller_start(c, &identity, &in, 0);
}

/* Take what the controller has to say off the line. */
static inline void bench_drain(struct controller *c)
{
    uint8_t byte;
    while (outbox_take(&c->outbox, &byte)) {
    }
}

static inline void bench_holds(const struct controller *c)
{
    MUST(c->left.pwm >= -1000 && c->left.pwm <= 1000);
    MUST(c->right.pwm >= -1000 && c->right.pwm <= 1000);
    MUST(c->brush_pct <= 100u && c->fan_pct <= 100u);
    MUST(c->session != 0u || !c->has_order);
    if (c->stop_reason != WIRE_STOP_REASON_NONE) {
        MUST(!c->has_order);
        MUST(c->left.pwm == 0 && c->right.pwm == 0);
        MUST(c->left.target_um_s == 0 && c->right.target_um_s == 0);
        MUST(c->brush_pct == 0u && c->fan_pct == 0u);
    }
    if (!c->has_order) { /* nothing is driven without an order */
        MUST(c->left.pwm == 0 && c->right.pwm == 0 && c->brush_pct == 0u && c->fan_pct == 0u);
    } else {
        MUST(labs((long)c->left.target_um_s) <= WIRE_MAX_WHEEL_MM_S * 1000L);
        MUST(labs((long)c->right.target_um_s) <= WIRE_MAX_WHEEL_MM_S * 1000L);
        MUST(c->order_valid_us > 0u && c->order_valid_us <= WIRE_MAX_VALID_FOR_MS * 1000u);
    }
}

#endif
