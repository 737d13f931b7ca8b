/* The board's loop: bytes in, bytes out, and one step of the core each millisecond. */
#include "board/atmega328p/parts.h"
#include "board/hal.h"
#include "core/controller.h"

#define STEP_US UINT32_C(1000)
#define BYTES_A_TURN 16u

static struct controller controller;

static void serve_line(uint32_t now_us)
{
    uint8_t byte;
    for (uint8_t i = 0; (i < BYTES_A_TURN) && hal_receive(&byte); i++) {
        controller_receive(&controller, byte, now_us);
    }
    hal_wake_line();
}

bool line_next_byte(uint8_t *byte)
{
    return outbox_take(&controller.outbox, byte);
}

int main(void)
{
    struct inputs in;
    struct outputs out;
    const struct identity identity = {
        .board = WIRE_BOARD_ATMEGA328P,
        .boot = hal_start(),
        .build = FIRMWARE_BUILD,
    };
    uint32_t stepped_us = hal_now_us();
    hal_read(&in);
    controller_start(&controller, &identity, &in, stepped_us);
    for (;;) {
        uint32_t now_us = hal_now_us();
        serve_line(now_us);
        if ((now_us - stepped_us) >= STEP_US) {
            stepped_us = ((now_us - stepped_us) < (2u * STEP_US)) ? (stepped_us + STEP_US) : now_us;
            hal_read(&in);
            controller_step(&controller, &in, now_us, &out);
            hal_write(&out);
            hal_feed_watchdog();
        }
        hal_idle();
    }
}
