/* What every board gives to `main` around the core; board/host does the same over two pipes. */
#ifndef BOARD_HAL_H
#define BOARD_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "core/board_types.h"

/* Set pins, timers, serial port and watchdog; returns the number of this start. */
uint16_t hal_start(void);

/* Microseconds since the start; wraps. */
uint32_t hal_now_us(void);

/* The latest samples; never waits. */
void hal_read(struct inputs *in);

/* Wheels, brush and fan. */
void hal_write(const struct outputs *out);

/* Next byte from the line; false when there is none. */
bool hal_receive(uint8_t *byte);

/* There are bytes to send: the line fetches them, in its interrupt, until there are none. */
void hal_wake_line(void);

/* What the line fetches; main provides it. False when there is none. */
bool line_next_byte(uint8_t *byte);

/* Sleep until the next interrupt: a tenth of a millisecond at most, for there is always one. */
void hal_idle(void);

/* Everything is well: do not reset. */
void hal_feed_watchdog(void);

#endif
