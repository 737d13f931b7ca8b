/* Bytes waiting for the line: one writer (the core), one reader (the board, maybe an interrupt).
 * The indices are single bytes that wrap by themselves, so neither side needs a lock. */
#ifndef CORE_OUTBOX_H
#define CORE_OUTBOX_H

#include <stdbool.h>
#include <stdint.h>

struct outbox {
    volatile uint8_t head;
    volatile uint8_t tail;
    uint16_t dropped; /* frames that did not fit; wraps */
    uint8_t bytes[256];
};

/* Frame a body and queue it whole, or drop it whole. */
void outbox_send(struct outbox *box, const uint8_t *body, uint8_t length);

/* Take the next byte; false when there is none. */
bool outbox_take(struct outbox *box, uint8_t *byte);

#endif
